//! Text over the picture: the status line and the list of keys.

use std::convert::Infallible;

use embedded_graphics::Drawable;
use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::ascii::{FONT_7X13, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::text::{Baseline, Text};

use crate::show::half;

/// Pixels between the text and the edge of its panel.
const MARGIN: usize = 4;
const BRIGHT: Rgb888 = Rgb888::WHITE;
const SEPARATOR: &str = "  |  ";

/// A buffer of 0x00RRGGBB that text can be drawn into.
pub(super) struct Canvas<'a> {
    pixels: &'a mut [u32],
    width: usize,
    height: usize,
    font: &'static MonoFont<'static>,
}

impl<'a> Canvas<'a> {
    /// The buffer holds `width` x `height` pixels row by row; `scale` is that of the screen, 1 for common ones.
    pub(super) fn new(pixels: &'a mut [u32], width: usize, height: usize, scale: f64) -> Self {
        let height = height.min(pixels.len() / width.max(1));
        let font = if scale >= 1.5 {
            &FONT_10X20
        } else {
            &FONT_7X13
        };
        Self {
            pixels,
            width,
            height,
            font,
        }
    }

    /// Writes items along the bottom, side by side as far as they fit.
    pub(super) fn status(&mut self, items: &[String]) {
        let lines = wrap(items, self.columns());
        let height = self.panel_height(lines.len());
        self.panel(0, self.height.saturating_sub(height), self.width, &lines);
    }

    /// Marks a place, pixels, with a cross.
    pub(super) fn cross(&mut self, [x, y]: [f32; 2]) {
        let middle = Point::new(x.floor() as i32, y.floor() as i32);
        let arms = (-5..=5).flat_map(|k| [Point::new(k, 0), Point::new(0, k)]);
        let Ok(()) = self.draw_iter(arms.map(|arm| Pixel(middle + arm, BRIGHT)));
    }

    /// Writes lines in the middle.
    pub(super) fn panel_in_the_middle(&mut self, lines: &[&str]) {
        let longest = lines.iter().map(|l| l.chars().count()).max().unwrap_or(0);
        let width = (longest * self.advance() + 2 * MARGIN).min(self.width);
        let height = self.panel_height(lines.len()).min(self.height);
        let lines: Vec<String> = lines.iter().map(|&l| l.to_owned()).collect();
        self.panel(
            (self.width - width) / 2,
            (self.height - height) / 2,
            width,
            &lines,
        );
    }

    fn advance(&self) -> usize {
        (self.font.character_size.width + self.font.character_spacing) as usize
    }

    fn columns(&self) -> usize {
        (self.width.saturating_sub(2 * MARGIN) / self.advance()).max(1)
    }

    fn panel_height(&self, lines: usize) -> usize {
        lines * self.font.character_size.height as usize + 2 * MARGIN
    }

    fn panel(&mut self, left: usize, top: usize, width: usize, lines: &[String]) {
        let bottom = (top + self.panel_height(lines.len())).min(self.height);
        let right = (left + width).min(self.width);
        for y in top..bottom {
            let row = &mut self.pixels[y * self.width + left..y * self.width + right];
            // A quarter of what is below shines through.
            row.iter_mut().for_each(|p| *p = half(half(*p)));
        }
        let style = MonoTextStyle::new(self.font, BRIGHT);
        for (i, line) in lines.iter().enumerate() {
            let y = top + MARGIN + i * self.font.character_size.height as usize;
            let at = Point::new((left + MARGIN) as i32, y as i32);
            let Ok(_) = Text::with_baseline(line, at, style, Baseline::Top).draw(self);
        }
    }
}

impl OriginDimensions for Canvas<'_> {
    fn size(&self) -> Size {
        Size::new(self.width as u32, self.height as u32)
    }
}

impl DrawTarget for Canvas<'_> {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            let (Ok(x), Ok(y)) = (usize::try_from(at.x), usize::try_from(at.y)) else {
                continue;
            };
            if x < self.width && y < self.height {
                self.pixels[y * self.width + x] = u32::from(colour.r()) << 16
                    | u32::from(colour.g()) << 8
                    | u32::from(colour.b());
            }
        }
        Ok(())
    }
}

/// Puts items on lines of so many characters; an item that is longer than a line is cut into several.
fn wrap(items: &[String], columns: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for item in items {
        let characters: Vec<char> = item.chars().map(printable).collect();
        for (i, piece) in characters.chunks(columns).enumerate() {
            match lines.last_mut() {
                Some(line) if i == 0 && line.len() + SEPARATOR.len() + piece.len() <= columns => {
                    line.push_str(SEPARATOR);
                    line.extend(piece);
                }
                _ => lines.push(piece.iter().collect()),
            }
        }
    }
    lines
}

/// The built-in fonts are ASCII alone.
fn printable(c: char) -> char {
    match c {
        ' '..='~' => c,
        c if c.is_whitespace() => ' ',
        _ => '?',
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_share_lines_and_long_ones_are_cut() {
        let items = ["one", "two", "a much longer item", "x\ny\u{e9}"].map(String::from);
        assert_eq!(
            wrap(&items, 12),
            ["one  |  two", "a much longe", "r item", "x y?"]
        );
        assert_eq!(wrap(&items, 1).len(), 3 + 3 + 18 + 4);
    }

    #[test]
    fn text_is_bright_on_dark_and_stays_inside_any_window() {
        for (width, height) in [(400, 60), (9, 7), (1, 1), (0, 0), (64, 8)] {
            let mut pixels = vec![0xff_ffff; width * height];
            let mut canvas = Canvas::new(&mut pixels, width, height, 1.0);
            canvas.status(&["62 frames/s".into(), "settled".into()]);
            canvas.panel_in_the_middle(&["H  keys", "Esc  quit"]);
        }
        let mut pixels = vec![0xff_ffff; 400 * 60];
        Canvas::new(&mut pixels, 400, 60, 1.0).status(&["HHH".into()]);
        assert!(pixels[..400 * 39].iter().all(|&p| p == 0xff_ffff));
        let panel = &pixels[400 * 39..];
        assert!(panel.contains(&0x3f_3f3f));
        let lit = panel.iter().filter(|&&p| p == 0xff_ffff).count();
        assert!((30..200).contains(&lit), "{lit}");
    }
}
