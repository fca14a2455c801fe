//! What was typed: the command line of the display.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use protocol::messages::{SHADOW_ERROR, ShadowMethod};

use crate::config::Choices;
use crate::show::Show;
use crate::traces::Recorder;

/// Shown where no scene is named.
pub const DEFAULT_SCENE: &str = "chains";

/// Looks at expensive lighting interactively: sharp pictures from sparse samples and analytic edges.
#[derive(Debug, Parser)]
#[command(version, args_conflicts_with_subcommands = true)]
pub struct Cli {
    /// What to do; with no command a window opens
    #[command(subcommand)]
    pub command: Option<Command>,
    /// What the window shows
    #[command(flatten)]
    pub window: WindowArgs,
}

/// Commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render frames to files, without a window
    Render(Box<RenderArgs>),
    /// Record a session as a trace: every frame between display and shader servers, and what the display does with it
    Record(RecordArgs),
    /// Replay a trace: draw its pictures again, serve it to a display, or play its display to a shader server
    Replay(Box<ReplayArgs>),
    /// Run as a shader server (what the display starts by itself)
    #[command(name = "shader-server", disable_help_flag = true, hide = true)]
    ShaderServer {
        /// As for the shader-server program
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        args: Vec<std::ffi::OsString>,
    },
}

/// Options of `record`.
#[derive(Args, Clone, Debug)]
pub struct RecordArgs {
    /// File for the trace
    pub trace: PathBuf,
    /// What to record: `render` with its arguments, or those of the window
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "COMMAND"
    )]
    pub command: Vec<std::ffi::OsString>,
}

/// Options of `replay`.
#[derive(Args, Clone, Debug)]
#[command(group = clap::ArgGroup::new("what").required(true).args(["out", "listen", "connect"]))]
pub struct ReplayArgs {
    /// The trace
    pub trace: PathBuf,
    /// Draw the recorded pictures again into this directory, from the trace alone and the same to the bit
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Serve the recorded answers to displays that connect here; port 0 for any free port
    #[arg(long, value_name = "ADDR")]
    pub listen: Option<SocketAddr>,
    /// Play the recorded display to these shader servers and compare their answers
    #[arg(long, num_args = 1.., value_name = "ADDR")]
    pub connect: Vec<String>,
    /// Keep the recorded timing
    #[arg(long)]
    pub real_time: bool,
    /// Also write linear radiance as OpenEXR
    #[arg(long, requires = "out")]
    pub exr: bool,
    /// Which frames become files: all, last, none or every:N
    #[arg(long, default_value = "all", value_parser = parse_write, value_name = "WHICH")]
    pub write: Write,
    /// What the frames show: the picture or a stage of its making
    #[arg(long, value_enum, default_value_t, value_name = "STAGE")]
    pub show: Show,
    /// Threads of the display
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: u16,
    /// Write a JSON line a frame here
    #[arg(long, value_name = "FILE", requires = "out")]
    pub stats: Option<PathBuf>,
    /// Serve one display, and exit when it has left
    #[arg(long, requires = "listen")]
    pub once: bool,
    /// Exit when standard input closes
    #[arg(long, requires = "listen", hide = true)]
    pub parent_stdin: bool,
}

/// Where samples come from.
#[derive(Args, Clone, Debug)]
pub struct ServerArgs {
    /// Shader servers to use, HOST:PORT, instead of starting one; a host name stands for all that it leads to
    #[arg(long, num_args = 1.., value_name = "ADDR", conflicts_with = "shader")]
    pub connect: Vec<String>,
    /// Wait here for shader servers that dial in, IP:PORT, instead of starting one
    #[arg(long, value_name = "ADDR", conflicts_with = "shader")]
    pub accept: Option<SocketAddr>,
    /// File with the secret that the display and its servers prove to each other; addresses beyond this machine need one
    #[arg(long, value_name = "FILE", conflicts_with = "shader")]
    pub secret_file: Option<PathBuf>,
    /// Program to start as shader server instead of the one built in
    #[arg(long, value_name = "PATH")]
    pub shader: Option<PathBuf>,
    /// How many shader servers to start
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=64))]
    pub shaders: u16,
    /// Threads of each shader server that is started (default: all cores, shared among them; all but one with a window)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub shader_threads: Option<u16>,
    /// How servers find the visibility of every light, whatever the scene says of each
    #[arg(long, value_enum, value_name = "METHOD")]
    pub shadows: Option<Shadows>,
    /// Error that `--shadows auto` may make: root mean square over a light's penumbrae, as a share of the light in full view
    #[arg(long, default_value_t = SHADOW_ERROR, value_name = "SHARE", value_parser = parse_share)]
    pub shadow_error: f32,
    /// The shader server that is built in takes equally many shadow rays everywhere: noisier, and right on average.
    #[arg(skip)]
    pub even_shadow_rays: bool,
    /// Servers are asked for samples that depend on no machine and no time: none comes before its indirect light is computed.
    #[arg(skip)]
    pub steady: bool,
    /// Takes the session down.
    #[arg(skip)]
    pub recorder: Option<Recorder>,
}

/// How the visibility of lights is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shadows {
    /// The cheapest that keeps the error of `--shadow-error`
    Auto,
    /// Shadow rays, stratified and adaptive
    Rays,
    /// Hierarchical penumbra casting
    Penumbra,
    /// Soft shadow maps
    SoftMap,
}

impl From<Shadows> for ShadowMethod {
    fn from(shadows: Shadows) -> Self {
        match shadows {
            Shadows::Auto => Self::Auto,
            Shadows::Rays => Self::Rays,
            Shadows::Penumbra => Self::Penumbra,
            Shadows::SoftMap => Self::SoftMap,
        }
    }
}

/// Options of the window.
#[derive(Args, Clone, Debug)]
pub struct WindowArgs {
    /// Scene file (.toml), mesh file (.obj, .ply, .stl, .gltf, .glb), or the name of a built-in scene
    pub scene: Option<String>,
    /// Size of the window, pixels
    #[arg(long, default_value = "768x768", value_parser = parse_size, value_name = "WxH")]
    pub size: (u32, u32),
    /// Most samples to ask for in a frame (default: as many as the servers manage)
    #[arg(long, value_name = "K")]
    pub samples_per_frame: Option<usize>,
    /// Where frames go if there is no display server, and screenshots
    #[arg(long, default_value = "out", value_name = "DIR")]
    pub out: PathBuf,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Threads of the display itself
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: u16,
    /// Say how each light is treated, what that saves and what error it allows: at the start and at the end
    #[arg(long)]
    pub explain: bool,
    /// Where samples come from
    #[command(flatten)]
    pub servers: ServerArgs,
    /// How pictures are made
    #[command(flatten)]
    pub choices: Choices,
}

impl WindowArgs {
    /// What to render where there is no display server: two seconds along the scene's first path, if it has one.
    pub fn headless(&self, path: Option<String>) -> RenderArgs {
        RenderArgs {
            scene: self
                .scene
                .clone()
                .unwrap_or_else(|| DEFAULT_SCENE.to_owned()),
            out: self.out.clone(),
            path,
            fps: 30.0,
            frames: 60,
            size: self.size,
            seed: self.seed,
            samples_per_frame: self.samples_per_frame,
            lockstep: true,
            spp: 64,
            exr: false,
            write: Write::Every(10),
            show: Show::Picture,
            threads: self.threads,
            stats: None,
            explain: self.explain,
            servers: self.servers.clone(),
            choices: self.choices,
        }
    }
}

/// Options of `render`.
#[derive(Args, Clone, Debug)]
pub struct RenderArgs {
    /// Scene file (.toml), mesh file (.obj, .ply, .stl, .gltf, .glb), or the name of a built-in scene
    pub scene: String,
    /// Directory for the frames; made if it is not there
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Paths of the scene to play: of the camera, objects and lights; without one of the camera it stands still
    #[arg(long, value_name = "NAME")]
    pub path: Option<String>,
    /// Frames a second of the path's time
    #[arg(long, default_value_t = 30.0, value_name = "RATE")]
    pub fps: f32,
    /// Frames to render
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub frames: usize,
    /// Size of the frames, pixels
    #[arg(long, default_value = "512x512", value_parser = parse_size, value_name = "WxH")]
    pub size: (u32, u32),
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Samples to ask for in each frame (default: 2 % of the pixels)
    #[arg(long, value_name = "K")]
    pub samples_per_frame: Option<usize>,
    /// Let each frame wait for its samples: the same pictures whatever the machine
    #[arg(long)]
    pub lockstep: bool,
    /// Samples a pixel of `--method reference`
    #[arg(long, default_value_t = 64, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub spp: u32,
    /// Also write linear radiance as OpenEXR
    #[arg(long)]
    pub exr: bool,
    /// Which frames become files: all, last, none or every:N
    #[arg(long, default_value = "all", value_parser = parse_write, value_name = "WHICH")]
    pub write: Write,
    /// What the frames show: the picture or a stage of its making (not for `full` and `reference`)
    #[arg(long, value_enum, default_value_t, value_name = "STAGE")]
    pub show: Show,
    /// Threads of the display itself
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: u16,
    /// Write a JSON line a frame here
    #[arg(long, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    /// Say in the end how each light was treated, what that saved and what error it allowed
    #[arg(long)]
    pub explain: bool,
    /// Where samples come from
    #[command(flatten)]
    pub servers: ServerArgs,
    /// How pictures are made
    #[command(flatten)]
    pub choices: Choices,
}

/// Which frames become files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Write {
    /// Each.
    All,
    /// The last alone.
    Last,
    /// None.
    None,
    /// Frames 0, N, 2N and so on.
    Every(usize),
}

impl Write {
    /// Whether this frame of so many becomes a file.
    pub fn wants(self, frame: usize, frames: usize) -> bool {
        match self {
            Self::All => true,
            Self::Last => frame + 1 == frames,
            Self::None => false,
            Self::Every(n) => frame.is_multiple_of(n),
        }
    }
}

fn parse_write(text: &str) -> Result<Write, String> {
    match text {
        "all" => Ok(Write::All),
        "last" => Ok(Write::Last),
        "none" => Ok(Write::None),
        _ => match text.strip_prefix("every:").map(str::parse::<usize>) {
            Some(Ok(n)) if n > 0 => Ok(Write::Every(n)),
            _ => Err("give all, last, none or every:N with N at least 1".into()),
        },
    }
}

fn parse_share(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("give a share from 0 to 1, such as 0.02".into()),
    }
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let parts = text
        .split_once('x')
        .and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match parts {
        Some((w, h)) if (1..=16_384).contains(&w) && (1..=16_384).contains(&h) => Ok((w, h)),
        _ => Err("give WIDTHxHEIGHT, each from 1 to 16384, such as 512x512".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_frames_to_write_are_read() {
        assert_eq!(parse_size("512x384"), Ok((512, 384)));
        for bad in ["", "512", "0x5", "5x-5", "99999x1", "512x512x3"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_write("every:10"), Ok(Write::Every(10)));
        assert!(parse_write("every:0").is_err() && parse_write("some").is_err());
        let wanted = |w: Write| (0..4).filter(|&f| w.wants(f, 4)).collect::<Vec<_>>();
        assert_eq!(wanted(Write::Every(2)), [0, 2]);
        assert_eq!(wanted(Write::Last), [3]);
    }

    #[test]
    fn the_command_line_is_well_formed() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }
}
