//! What is on screen, as files.

use std::path::{Path, PathBuf};

use crate::epi::grid::Grid;
use crate::headless::{OutputError, write_exr, write_png};

/// Writes what is shown (0x00RRGGBB row by row) as PNG and the linear picture as OpenEXR, under the first free name of
/// the folder, which is made if need be. Returns the PNG's path.
///
/// # Errors
/// If a file cannot be written.
pub(super) fn save(
    folder: &Path,
    shown: &[u32],
    (grid, rgb): (Grid, &[Vec<f32>; 3]),
) -> Result<PathBuf, OutputError> {
    std::fs::create_dir_all(folder).map_err(|e| OutputError::new(folder, &e))?;
    let png = (1..)
        .map(|n| folder.join(format!("screenshot-{n:04}.png")))
        .find(|path| !path.exists())
        .unwrap_or_else(|| folder.join("screenshot.png"));
    write_png(&png, grid.width as u32, grid.height as u32, shown)?;
    write_exr(&png.with_extension("exr"), grid, rgb)?;
    Ok(png)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_screenshot_gets_a_name_of_its_own() {
        let folder = std::env::temp_dir().join(format!("screenshots-{}", std::process::id()));
        let grid = Grid::new(3, 2);
        let rgb: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.25; grid.elements()]);
        let shown = [0xff_0000, 2, 3, 4, 5, 0x00_00ff];
        let first = save(&folder, &shown, (grid, &rgb)).unwrap();
        let second = save(&folder, &shown, (grid, &rgb)).unwrap();
        assert_ne!(first, second);
        let read = image::open(&second).unwrap().to_rgb8();
        assert_eq!(read.dimensions(), (3, 2));
        assert_eq!(read.get_pixel(2, 1).0, [0, 0, 255]);
        let linear = image::open(first.with_extension("exr"))
            .unwrap()
            .to_rgb32f();
        assert_eq!(linear.get_pixel(1, 1).0, [0.25; 3]);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
