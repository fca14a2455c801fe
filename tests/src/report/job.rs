//! What the renderer is asked to do, and the command line that says so (DESIGN section 7).

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// How the renderer makes its picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// The default: sparse samples and edges.
    EdgeAndPoint,
    /// The same without the complex filter.
    NoComplex,
    /// The same samples without edges: the Render Cache.
    PointsOnly,
    /// Every pixel shaded once, no reconstruction.
    Full,
    /// This many jittered samples a pixel, box-filtered.
    Reference(u32),
}

impl Method {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::EdgeAndPoint => "edge-and-point",
            Self::NoComplex => "no-complex",
            Self::PointsOnly => "points-only",
            Self::Full => "full",
            Self::Reference(_) => "reference",
        }
    }
}

/// Which edges of shadows keep samples apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Shadows {
    /// The default: those that are worth it.
    Chosen,
    /// None.
    Off,
    /// Every umbral and penumbral edge.
    All,
    /// Those whose penumbra on screen is narrower than so many hundredths of the mean distance between samples.
    Narrower(u32),
}

impl Shadows {
    /// Its name on the page.
    pub fn name(self) -> String {
        match self {
            Self::Chosen => "chosen".to_owned(),
            Self::Off => "off".to_owned(),
            Self::All => "all".to_owned(),
            Self::Narrower(width) => format!("narrower than {}", f64::from(width) / 100.0),
        }
    }
}

/// Which frames become files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Write {
    /// Every frame.
    All,
    /// The last one.
    Last,
    /// None.
    None,
    /// Every n-th.
    Every(u32),
}

/// One run of `renderer render`, always in lockstep.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Job {
    /// A scene file or a built-in name.
    pub scene: PathBuf,
    /// How the picture is made.
    pub method: Method,
    /// Width and height, pixels.
    pub size_px: [u32; 2],
    /// Number of frames.
    pub frames: u32,
    /// A path of the scene; a still camera without.
    pub path: Option<String>,
    /// Frames a second of the path's time.
    pub fps: u32,
    /// Sample budget a frame, for the methods that have one.
    pub samples_per_frame: u32,
    /// Which frames are written, as PNG and EXR.
    pub write: Write,
    /// The display's own threads; its default (one) without.
    pub threads: Option<u32>,
    /// Seed of all random choices.
    pub seed: u32,
    /// Which edges of shadows keep samples apart.
    pub shadows: Shadows,
    /// How servers find the visibility of all lights, as `--shadows` names it; as the scene and they like without.
    pub visibility: Option<&'static str>,
}

impl Job {
    /// Arguments after the program's name.
    pub fn args(&self, out: &Path, stats: &Path) -> Vec<OsString> {
        let [width, height] = self.size_px;
        let mut args: Vec<OsString> = vec!["render".into(), self.scene.clone().into()];
        let mut option = |name: &str, value: OsString| args.extend([name.into(), value]);
        option("--out", out.into());
        option("--frames", self.frames.to_string().into());
        option("--size", format!("{width}x{height}").into());
        option(
            "--samples-per-frame",
            self.samples_per_frame.to_string().into(),
        );
        option("--stats", stats.into());
        option("--seed", self.seed.to_string().into());
        option("--method", self.method.name().into());
        if let Method::Reference(spp) = self.method {
            option("--spp", spp.to_string().into());
        }
        if let Some(path) = &self.path {
            option("--path", path.into());
            option("--fps", self.fps.to_string().into());
        }
        if let Some(threads) = self.threads {
            option("--threads", threads.to_string().into());
        }
        match self.shadows {
            Shadows::Chosen => {}
            Shadows::Off => option("--shadow-edges", "off".into()),
            Shadows::All => option("--shadow-edges", "all".into()),
            Shadows::Narrower(width) => {
                let ratio = f64::from(width) / 100.0;
                option("--shadow-width", ratio.to_string().into());
            }
        }
        if let Some(method) = self.visibility {
            option("--shadows", method.into());
        }
        let write = match self.write {
            Write::All => "all".to_owned(),
            Write::Last => "last".to_owned(),
            Write::None => "none".to_owned(),
            Write::Every(n) => format!("every:{n}"),
        };
        option("--write", write.into());
        args.push("--lockstep".into());
        if self.write != Write::None {
            args.push("--exr".into());
        }
        args
    }
}

#[cfg(test)]
pub(super) fn example() -> Job {
    Job {
        scene: "scenes/chains.toml".into(),
        method: Method::Reference(16),
        size_px: [320, 200],
        frames: 3,
        path: Some("orbit".to_owned()),
        fps: 30,
        samples_per_frame: 1280,
        write: Write::Every(2),
        threads: Some(1),
        seed: 7,
        shadows: Shadows::Chosen,
        visibility: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visibility_is_named_where_it_is_forced() {
        let job = Job {
            visibility: Some("penumbra"),
            ..example()
        };
        let args = job.args(Path::new("o"), Path::new("s"));
        let place = args.iter().position(|arg| arg == "--shadows");
        assert_eq!(place.map(|i| args[i + 1].to_str()), Some(Some("penumbra")));
    }

    #[test]
    fn the_command_line_is_the_contract_s() {
        let words = |job: Job| {
            let args = job.args(Path::new("o"), Path::new("s"));
            let words: Vec<_> = args.iter().map(|a| a.to_string_lossy()).collect();
            words.join(" ")
        };
        let start = "render scenes/chains.toml --out o --frames 3 --size 320x200 --samples-per-frame 1280 --stats s --seed 7 \
                     --method reference --spp 16 --path orbit --fps 30 --threads 1";
        for (shadows, option) in [
            (Shadows::Chosen, ""),
            (Shadows::Off, " --shadow-edges off"),
            (Shadows::All, " --shadow-edges all"),
            (Shadows::Narrower(150), " --shadow-width 1.5"),
        ] {
            assert_eq!(
                words(Job {
                    shadows,
                    ..example()
                }),
                format!("{start}{option} --write every:2 --lockstep --exr")
            );
        }
    }
}
