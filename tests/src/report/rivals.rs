//! What a user would pick instead: figures measured elsewhere, kept as data with their source.

use super::table::Table;

/// Where the figures come from.
pub const SOURCE: &str = "measured apart from this report: Mitsuba 3.9.1, OIDN 2.5, Cycles (Blender 5.0) and Radiance 6.0a \
    on two cores of an AVX-512 Xeon, 2 threads, 512x512, medians of at least 5 frames, on the scenes of the independent \
    references (chains: direct light; rooms: global illumination)";

/// Time and error of a rival in one scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figure {
    /// Time of a frame, milliseconds.
    pub frame_ms: f64,
    /// Peak signal-to-noise ratio, dB, on sRGB.
    pub psnr_db: f64,
    /// Mean FLIP.
    pub flip: f64,
    /// Mean FLIP near edges.
    pub flip_edges: f64,
}

/// A renderer and its settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rival {
    /// Short name.
    pub name: &'static str,
    /// In chains.
    pub chains: Option<Figure>,
    /// In rooms.
    pub rooms: Option<Figure>,
}

const fn figure(frame_ms: f64, psnr_db: f64, flip: f64, flip_edges: f64) -> Option<Figure> {
    Some(Figure {
        frame_ms,
        psnr_db,
        flip,
        flip_edges,
    })
}

/// All rivals measured.
pub const RIVALS: [Rival; 7] = [
    Rival {
        name: "Mitsuba 1 spp",
        chains: figure(28.0, 13.6, 0.159, 0.244),
        rooms: figure(174.0, 10.3, 0.316, 0.292),
    },
    Rival {
        name: "Mitsuba 16 spp",
        chains: figure(547.0, 27.7, 0.055, 0.087),
        rooms: figure(2596.0, 22.5, 0.111, 0.107),
    },
    Rival {
        name: "Mitsuba 1 spp + OIDN fast",
        chains: figure(217.0, 29.0, 0.101, 0.199),
        rooms: figure(515.0, 32.7, 0.105, 0.159),
    },
    Rival {
        name: "Mitsuba 1 spp + OIDN high",
        chains: figure(334.0, 29.5, 0.096, 0.185),
        rooms: figure(630.0, 33.3, 0.097, 0.152),
    },
    Rival {
        name: "Mitsuba 16 spp + OIDN high",
        chains: figure(800.0, 37.2, 0.041, 0.082),
        rooms: figure(2850.0, 40.1, 0.049, 0.076),
    },
    Rival {
        name: "Cycles 1 spp + OIDN high",
        chains: figure(2178.0, 31.0, 0.065, 0.146),
        rooms: figure(2637.0, 35.8, 0.074, 0.122),
    },
    Rival {
        name: "Radiance rpict, warm cache",
        chains: None,
        rooms: figure(9300.0, 29.5, 0.152, 0.154),
    },
];

/// Share of pixels (percent) with PSNR and FLIP in chains and in rooms: converged values at random pixels, joined
/// linearly over their Delaunay mesh. What sparse samples give without knowing any edge.
pub const WITHOUT_EDGES: [(f64, f64, f64, f64, f64); 5] = [
    (1.0, 18.2, 0.226, 25.6, 0.121),
    (2.0, 19.8, 0.179, 27.3, 0.097),
    (3.0, 21.2, 0.149, 28.1, 0.082),
    (10.0, 25.1, 0.081, 32.1, 0.044),
    (30.0, 29.8, 0.038, 36.3, 0.022),
];

impl Rival {
    /// Its figures in the scene of this name, where they were measured in it.
    pub fn in_scene(&self, name: &str) -> Option<Figure> {
        match name {
            "chains-reference" => self.chains,
            "rooms-reference" => self.rooms,
            _ => None,
        }
    }
}

/// All rivals as a table.
pub fn table() -> Table {
    let columns = [
        "what",
        "chains ms",
        "PSNR dB",
        "FLIP",
        "near edges",
        "rooms ms",
        "PSNR dB",
        "FLIP",
        "near edges",
    ];
    let mut table = Table::new("rivals", &format!("Rivals, {SOURCE}"), &columns);
    for rival in &RIVALS {
        let cells = [rival.chains, rival.rooms]
            .into_iter()
            .flat_map(|figure| match figure {
                Some(f) => [f.frame_ms, f.psnr_db, f.flip, f.flip_edges].map(|v| v.to_string()),
                None => [const { String::new() }; 4],
            });
        table.row([rival.name.to_owned()].into_iter().chain(cells));
    }
    table
}
