//! Embree 4, where its shared library is present, behind a safe face.
//!
//! Layouts, constants and signatures are those of Embree 4's headers (`rtcore_ray.h`, `rtcore_geometry.h`, `rtcore_scene.h`,
//! `rtcore_common.h`) for builds with one level of instances, which is how packages build it.
#![expect(
    unsafe_code,
    reason = "a shared library written in C can be called in no other way"
)]

use std::ffi::{c_int, c_void};
use std::path::{Path, PathBuf};
use std::ptr::null;

use glam::Vec3;
use libloading::Library;
use rays::Ray;

/// Rays in a packet.
pub const PACKET: usize = 8;

const NONE: u32 = u32::MAX;

/// Why Embree cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum EmbreeError {
    /// There is no such library, or it lacks a function.
    #[error("{path} is not Embree 4's library: {source}")]
    Library {
        /// What was to be loaded.
        path: PathBuf,
        /// What the loader said.
        source: libloading::Error,
    },
    /// The library refused to make something.
    #[error("Embree could not make a {what} (error {code})")]
    Refused {
        /// A device, a scene, a geometry or a buffer.
        what: &'static str,
        /// Embree's `RTCError`.
        code: c_int,
    },
    /// A face names a vertex that is not there.
    #[error("face {0} has a vertex past the end of the list")]
    Index(usize),
}

/// What a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmbreeHit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// The face.
    pub face: u32,
}

/// `RTCRayHit`, with room for the instance fields of every build.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct RayHit {
    origin: [f32; 3],
    near: f32,
    direction: [f32; 3],
    time: f32,
    far: f32,
    mask: u32,
    id: u32,
    flags: u32,
    normal: [f32; 3],
    uv: [f32; 2],
    primitive: u32,
    geometry: u32,
    instance: [u32; 2],
}

/// `RTCRayHit8`, likewise. `RTCRay8` is its first twelve rows.
#[repr(C, align(32))]
struct RayHit8 {
    origin: [[f32; PACKET]; 3],
    near: [f32; PACKET],
    direction: [[f32; PACKET]; 3],
    time: [f32; PACKET],
    far: [f32; PACKET],
    mask: [u32; PACKET],
    id: [u32; PACKET],
    flags: [u32; PACKET],
    normal: [[f32; PACKET]; 3],
    uv: [[f32; PACKET]; 2],
    primitive: [u32; PACKET],
    geometry: [u32; PACKET],
    instance: [[u32; PACKET]; 2],
}

type Handle = *mut c_void;

/// The functions that are used.
struct Functions {
    new_device: unsafe extern "C" fn(*const u8) -> Handle,
    device_error: unsafe extern "C" fn(Handle) -> c_int,
    release_device: unsafe extern "C" fn(Handle),
    new_scene: unsafe extern "C" fn(Handle) -> Handle,
    scene_flags: unsafe extern "C" fn(Handle, c_int),
    commit_scene: unsafe extern "C" fn(Handle),
    release_scene: unsafe extern "C" fn(Handle),
    new_geometry: unsafe extern "C" fn(Handle, c_int) -> Handle,
    new_buffer: unsafe extern "C" fn(Handle, c_int, u32, c_int, usize, usize) -> Handle,
    commit_geometry: unsafe extern "C" fn(Handle),
    attach: unsafe extern "C" fn(Handle, Handle) -> u32,
    release_geometry: unsafe extern "C" fn(Handle),
    intersect1: unsafe extern "C" fn(Handle, *mut RayHit, *const c_void),
    occluded1: unsafe extern "C" fn(Handle, *mut RayHit, *const c_void),
    intersect8: unsafe extern "C" fn(*const c_int, Handle, *mut RayHit8, *const c_void),
    occluded8: unsafe extern "C" fn(*const c_int, Handle, *mut RayHit8, *const c_void),
}

impl Functions {
    fn of(library: &Library) -> Result<Self, libloading::Error> {
        // SAFETY: every type below is the one that Embree 4's headers declare for the name.
        unsafe {
            Ok(Self {
                new_device: *library.get(b"rtcNewDevice\0")?,
                device_error: *library.get(b"rtcGetDeviceError\0")?,
                release_device: *library.get(b"rtcReleaseDevice\0")?,
                new_scene: *library.get(b"rtcNewScene\0")?,
                scene_flags: *library.get(b"rtcSetSceneFlags\0")?,
                commit_scene: *library.get(b"rtcCommitScene\0")?,
                release_scene: *library.get(b"rtcReleaseScene\0")?,
                new_geometry: *library.get(b"rtcNewGeometry\0")?,
                new_buffer: *library.get(b"rtcSetNewGeometryBuffer\0")?,
                commit_geometry: *library.get(b"rtcCommitGeometry\0")?,
                attach: *library.get(b"rtcAttachGeometry\0")?,
                release_geometry: *library.get(b"rtcReleaseGeometry\0")?,
                intersect1: *library.get(b"rtcIntersect1\0")?,
                occluded1: *library.get(b"rtcOccluded1\0")?,
                intersect8: *library.get(b"rtcIntersect8\0")?,
                occluded8: *library.get(b"rtcOccluded8\0")?,
            })
        }
    }
}

/// The library with a device.
pub struct Embree {
    functions: Functions,
    device: Handle,
}

impl Embree {
    /// Loads the shared library at `path`.
    ///
    /// # Errors
    /// [`EmbreeError`] when it is not Embree 4's or makes no device.
    pub fn load(path: &Path) -> Result<Self, EmbreeError> {
        let failed = |source| EmbreeError::Library {
            path: path.to_owned(),
            source,
        };
        // SAFETY: the user names the library to run; Embree's start-up code asks nothing of its caller.
        let library = unsafe { Library::new(path) }.map_err(failed)?;
        // Never unloaded: its worker threads may outlive the device.
        let library: &'static Library = Box::leak(Box::new(library));
        let functions = Functions::of(library).map_err(failed)?;
        // SAFETY: a null configuration is the default one.
        let device = unsafe { (functions.new_device)(null()) };
        let embree = Self { functions, device };
        embree.made("device", device)?;
        Ok(embree)
    }

    fn made(&self, what: &'static str, handle: Handle) -> Result<Handle, EmbreeError> {
        if handle.is_null() {
            // SAFETY: a null device asks for the thread's error.
            let code = unsafe { (self.functions.device_error)(self.device) };
            return Err(EmbreeError::Refused { what, code });
        }
        Ok(handle)
    }

    /// Builds a scene of one triangle mesh, in `robust` mode (watertight) or the default one.
    ///
    /// # Errors
    /// [`EmbreeError`] when a face is broken or memory is short.
    pub fn scene(
        &self,
        positions: &[Vec3],
        faces: &[[u32; 3]],
        robust: bool,
    ) -> Result<EmbreeScene<'_>, EmbreeError> {
        const TRIANGLES: c_int = 0;
        const ROBUST: c_int = 1 << 2;
        let past = |face: &[u32; 3]| face.iter().any(|i| *i as usize >= positions.len());
        if let Some(index) = faces.iter().position(past) {
            return Err(EmbreeError::Index(index));
        }
        let f = &self.functions;
        // SAFETY: the device is alive as long as `self`.
        let scene = EmbreeScene {
            embree: self,
            scene: self.made("scene", unsafe { (f.new_scene)(self.device) })?,
        };
        // SAFETY: handles come from the same device; Embree's buffers hold as many items as were asked for, of 12 bytes each.
        unsafe {
            if robust {
                (f.scene_flags)(scene.scene, ROBUST);
            }
            let geometry = self.made("geometry", (f.new_geometry)(self.device, TRIANGLES))?;
            let filled = self.fill(geometry, positions, faces);
            if filled.is_ok() {
                (f.commit_geometry)(geometry);
                (f.attach)(scene.scene, geometry);
            }
            (f.release_geometry)(geometry);
            filled?;
            (f.commit_scene)(scene.scene);
        }
        Ok(scene)
    }

    fn fill(
        &self,
        geometry: Handle,
        positions: &[Vec3],
        faces: &[[u32; 3]],
    ) -> Result<(), EmbreeError> {
        const INDICES: c_int = 0;
        const VERTICES: c_int = 1;
        const UINT3: c_int = 0x5003;
        const FLOAT3: c_int = 0x9003;
        let new = self.functions.new_buffer;
        // SAFETY: both kinds of item are 12 bytes, and the buffers are as long as what is copied.
        unsafe {
            let buffer = new(geometry, VERTICES, 0, FLOAT3, 12, positions.len());
            let buffer = self.made("buffer", buffer)?.cast::<Vec3>();
            positions
                .as_ptr()
                .copy_to_nonoverlapping(buffer, positions.len());
            let buffer = new(geometry, INDICES, 0, UINT3, 12, faces.len());
            let buffer = self.made("buffer", buffer)?.cast::<[u32; 3]>();
            faces.as_ptr().copy_to_nonoverlapping(buffer, faces.len());
        }
        Ok(())
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        if !self.device.is_null() {
            // SAFETY: made by this library; scenes borrow `self` and are gone.
            unsafe { (self.functions.release_device)(self.device) };
        }
    }
}

/// A committed scene.
pub struct EmbreeScene<'a> {
    embree: &'a Embree,
    scene: Handle,
}

impl Drop for EmbreeScene<'_> {
    fn drop(&mut self) {
        // SAFETY: made by this library and released once.
        unsafe { (self.embree.functions.release_scene)(self.scene) };
    }
}

impl EmbreeScene<'_> {
    /// The closest hit at a distance of at most `t_max`.
    #[inline]
    pub fn closest(&self, ray: &Ray, t_max: f32) -> Option<EmbreeHit> {
        let mut query = single(ray, t_max);
        // SAFETY: a committed scene, and a ray of the layout asked for.
        unsafe { (self.embree.functions.intersect1)(self.scene, &raw mut query, null()) };
        (query.geometry != NONE).then_some(EmbreeHit {
            t: query.far,
            face: query.primitive,
        })
    }

    /// Whether the ray meets anything at a distance of at most `t_max`.
    #[inline]
    pub fn blocked(&self, ray: &Ray, t_max: f32) -> bool {
        let mut query = single(ray, t_max);
        // SAFETY: as above; the ray is the query's first part.
        unsafe { (self.embree.functions.occluded1)(self.scene, &raw mut query, null()) };
        query.far == f32::NEG_INFINITY
    }

    /// [`closest`](Self::closest) for up to eight rays.
    #[inline]
    pub fn closest_of_packet(&self, rays: &[Ray], t_max: f32) -> [Option<EmbreeHit>; PACKET] {
        let (mut query, valid) = packet(rays, t_max);
        let call = self.embree.functions.intersect8;
        // SAFETY: a committed scene, and a packet of the layout and alignment asked for.
        unsafe { call(valid.0.as_ptr(), self.scene, &raw mut query, null()) };
        std::array::from_fn(|i| {
            (query.geometry[i] != NONE).then_some(EmbreeHit {
                t: query.far[i],
                face: query.primitive[i],
            })
        })
    }

    /// [`blocked`](Self::blocked) for up to eight rays, one bit a ray.
    #[inline]
    pub fn blocked_of_packet(&self, rays: &[Ray], t_max: f32) -> u32 {
        let (mut query, valid) = packet(rays, t_max);
        let call = self.embree.functions.occluded8;
        // SAFETY: as above.
        unsafe { call(valid.0.as_ptr(), self.scene, &raw mut query, null()) };
        (0..rays.len().min(PACKET)).fold(0, |bits, i| {
            bits | u32::from(query.far[i] == f32::NEG_INFINITY) << i
        })
    }
}

#[inline]
fn single(ray: &Ray, t_max: f32) -> RayHit {
    RayHit {
        origin: ray.origin.to_array(),
        near: 0.,
        direction: ray.direction.to_array(),
        time: 0.,
        far: t_max,
        mask: u32::MAX,
        id: 0,
        flags: 0,
        normal: [0.; 3],
        uv: [0.; 2],
        primitive: NONE,
        geometry: NONE,
        instance: [NONE; 2],
    }
}

/// Which rays of a packet count (-1) or not (0).
#[repr(C, align(32))]
struct Valid([c_int; PACKET]);

#[inline]
fn packet(rays: &[Ray], t_max: f32) -> (RayHit8, Valid) {
    let ray = |i: usize| rays.get(i).or(rays.first());
    let row = |get: &dyn Fn(&Ray) -> f32| std::array::from_fn(|i| ray(i).map_or(0., get));
    let query = RayHit8 {
        origin: [
            row(&|r| r.origin.x),
            row(&|r| r.origin.y),
            row(&|r| r.origin.z),
        ],
        near: [0.; PACKET],
        direction: [
            row(&|r| r.direction.x),
            row(&|r| r.direction.y),
            row(&|r| r.direction.z),
        ],
        time: [0.; PACKET],
        far: [t_max; PACKET],
        mask: [u32::MAX; PACKET],
        id: [0; PACKET],
        flags: [0; PACKET],
        normal: [[0.; PACKET]; 3],
        uv: [[0.; PACKET]; 2],
        primitive: [NONE; PACKET],
        geometry: [NONE; PACKET],
        instance: [[NONE; PACKET]; 2],
    };
    let valid = std::array::from_fn(|i| if i < rays.len() { -1 } else { 0 });
    (query, Valid(valid))
}
