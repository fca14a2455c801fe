//! From `[[path]]` tables to paths of the camera, of objects and of lights.

use protocol::scene::Scene;

use crate::error::ErrorKind;
use crate::format::{KeyTable, LightRef, PathTable, Scale};
use crate::lights::finite;
use crate::motion::{Motion, MotionKey, Moving};
use crate::path::{CameraPath, PathKey, Timing};

/// All paths of a scene.
#[derive(Debug, Default)]
pub(crate) struct Paths {
    pub(crate) cameras: Vec<CameraPath>,
    pub(crate) motions: Vec<Motion>,
}

/// What paths may name.
pub(crate) struct Subjects<'a> {
    scene: &'a Scene,
    lights: Vec<Option<&'a str>>,
}

/// Names that an error lists at most.
const LISTED: usize = 8;

impl<'a> Subjects<'a> {
    pub(crate) fn new(scene: &'a Scene, lights: Vec<Option<&'a str>>) -> Self {
        Self { scene, lights }
    }

    /// The object of that name, or else its parts, named NAME/PART.
    fn objects(&self, name: &str) -> Result<Moving, ErrorKind> {
        let names = || {
            self.scene
                .objects
                .iter()
                .map(|o| o.name.as_str())
                .zip(0u32..)
        };
        let mut found: Vec<u32> = names()
            .filter(|(n, _)| *n == name)
            .map(|(_, i)| i)
            .collect();
        if found.is_empty() {
            let part = |n: &str| {
                n.strip_prefix(name)
                    .is_some_and(|rest| rest.starts_with('/'))
            };
            found = names().filter(|(n, _)| part(n)).map(|(_, i)| i).collect();
        }
        if found.is_empty() {
            let known: Vec<&str> = names().map(|(n, _)| n).collect();
            return Err(unknown(
                "path.object",
                &format!("{name:?}"),
                "object",
                &known,
            ));
        }
        Ok(Moving::Objects(found))
    }

    fn light(&self, light: &LightRef) -> Result<Moving, ErrorKind> {
        let found = match light {
            LightRef::Number(n) => Some(*n).filter(|n| (*n as usize) < self.lights.len()),
            LightRef::Name(name) => {
                let mut named = self.lights.iter().zip(0u32..);
                named.find_map(|(n, i)| (*n == Some(name.as_str())).then_some(i))
            }
        };
        found.map(Moving::Light).ok_or_else(|| {
            let written = match light {
                LightRef::Number(n) => n.to_string(),
                LightRef::Name(name) => format!("{name:?}"),
            };
            let known: Vec<&str> = self.lights.iter().flatten().copied().collect();
            unknown("path.light", &written, "light", &known)
        })
    }
}

fn unknown(key: &str, written: &str, what: &str, known: &[&str]) -> ErrorKind {
    let listed = known
        .iter()
        .take(LISTED)
        .copied()
        .collect::<Vec<_>>()
        .join(", ");
    let remedy = match known.len() {
        0 => format!("no {what} has a name; give it one, or a number from 0"),
        n if n > LISTED => format!("name one of the scene's {n} {what}s: {listed}, ..."),
        _ => format!("name one of {listed}"),
    };
    ErrorKind::value(key, format!("there is no {what} {written}"), remedy)
}

impl Paths {
    /// Adds a path. Those of one name play together, so the camera, an object or a light may only be in one of them.
    pub(crate) fn add(
        &mut self,
        table: &PathTable,
        subjects: &Subjects<'_>,
    ) -> Result<(), ErrorKind> {
        if !(table.seconds > 0.0 && table.seconds.is_finite()) {
            let problem = format!("{} is no time", table.seconds);
            return Err(ErrorKind::value(
                "path.seconds",
                problem,
                "write a number greater than 0",
            ));
        }
        let moving = match (&table.object, &table.light) {
            (Some(_), Some(_)) => {
                let problem = "is given beside path.object";
                return Err(ErrorKind::value(
                    "path.light",
                    problem,
                    "write a path for each, of one name",
                ));
            }
            (Some(name), None) => Some(subjects.objects(name)?),
            (None, Some(light)) => Some(subjects.light(light)?),
            (None, None) => None,
        };
        let least = if moving.is_none() && !table.open {
            3
        } else {
            2
        };
        if table.keys.len() < least {
            let problem = format!("{} keys are too few", table.keys.len());
            let remedy = "a path needs at least 2, a closed one of the camera 3";
            return Err(ErrorKind::value("path.keys", problem, remedy));
        }
        let keys = table.keys.iter().enumerate();
        match moving {
            None => {
                self.check_name(table, self.cameras.iter().any(|q| q.name == table.name))?;
                self.cameras.push(CameraPath {
                    name: table.name.clone(),
                    seconds: table.seconds,
                    open: table.open,
                    step: table.step,
                    keys: keys
                        .map(|(i, k)| camera_key(i, k))
                        .collect::<Result<_, _>>()?,
                });
            }
            Some(moving) => {
                let taken = |q: &Motion| q.name == table.name && meet(&q.moving, &moving);
                self.check_name(table, self.motions.iter().any(taken))?;
                let light = matches!(moving, Moving::Light(_));
                self.motions.push(Motion {
                    name: table.name.clone(),
                    moving,
                    timing: Timing {
                        seconds: table.seconds,
                        open: table.open,
                        step: table.step,
                    },
                    keys: keys
                        .map(|(i, k)| motion_key(i, k, light))
                        .collect::<Result<_, _>>()?,
                });
            }
        }
        Ok(())
    }

    fn check_name(&self, table: &PathTable, taken: bool) -> Result<(), ErrorKind> {
        if !taken {
            return Ok(());
        }
        let problem = format!("two paths are called {:?} and move the same", table.name);
        Err(ErrorKind::value(
            "path.name",
            problem,
            "give each its own name",
        ))
    }
}

/// Whether something is moved by both.
fn meet(a: &Moving, b: &Moving) -> bool {
    match (a, b) {
        (Moving::Light(a), Moving::Light(b)) => a == b,
        (Moving::Objects(a), Moving::Objects(b)) => a.iter().any(|i| b.contains(i)),
        _ => false,
    }
}

fn camera_key(i: usize, table: &KeyTable) -> Result<PathKey, ErrorKind> {
    let name = format!("path.keys[{i}]");
    let stray = [
        ("translate", table.translate.is_some()),
        ("rotate", table.rotate.is_some()),
        ("scale", table.scale.is_some()),
        ("power", table.power.is_some()),
    ];
    if let Some((key, _)) = stray.iter().find(|(_, given)| *given) {
        let problem = "is no key of a camera's path";
        let remedy = "name what moves with object or light, or write eye and target";
        return Err(ErrorKind::value(format!("{name}.{key}"), problem, remedy));
    }
    let needed = |key: &str, value: Option<[f32; 3]>| match value {
        Some(v) => finite(&format!("{name}.{key}"), v),
        None => Err(ErrorKind::value(
            format!("{name}.{key}"),
            "is missing",
            "write eye and target",
        )),
    };
    let key = PathKey {
        eye: needed("eye", table.eye)?,
        target: needed("target", table.target)?,
    };
    if key.eye == key.target {
        return Err(ErrorKind::value(
            name,
            "the target is where the eye is",
            "move one of them",
        ));
    }
    Ok(key)
}

fn motion_key(i: usize, table: &KeyTable, light: bool) -> Result<MotionKey, ErrorKind> {
    let name = format!("path.keys[{i}]");
    let camera = "write the camera's keys as a path of its own with the same name";
    let (still, moves) = if light {
        ("a light only has translate and power", "remove it")
    } else {
        ("only a light has power", "remove it")
    };
    let stray = [
        ("eye", table.eye.is_some(), "is a key of the camera", camera),
        (
            "target",
            table.target.is_some(),
            "is a key of the camera",
            camera,
        ),
        ("rotate", light && table.rotate.is_some(), still, moves),
        ("scale", light && table.scale.is_some(), still, moves),
        ("power", !light && table.power.is_some(), still, moves),
    ];
    if let Some((key, _, problem, remedy)) = stray.iter().find(|s| s.1) {
        return Err(ErrorKind::value(format!("{name}.{key}"), *problem, *remedy));
    }
    let rest = MotionKey::REST;
    let key = MotionKey {
        translate: finite(
            &format!("{name}.translate"),
            table.translate.unwrap_or(rest.translate),
        )?,
        rotate: finite(
            &format!("{name}.rotate"),
            table.rotate.unwrap_or(rest.rotate),
        )?,
        scale: match table.scale.unwrap_or_default() {
            Scale::Uniform(s) => [s; 3],
            Scale::Axes(s) => s,
        },
        power: table.power.unwrap_or(rest.power),
    };
    if !key.scale.iter().all(|s| s.is_finite() && *s > 0.0) {
        let problem = format!("{:?} is no factor", key.scale);
        return Err(ErrorKind::value(
            format!("{name}.scale"),
            problem,
            "write numbers greater than 0",
        ));
    }
    if !(key.power.is_finite() && key.power >= 0.0) {
        let problem = format!("{} is no factor", key.power);
        return Err(ErrorKind::value(
            format!("{name}.power"),
            problem,
            "write a number of at least 0",
        ));
    }
    Ok(key)
}
