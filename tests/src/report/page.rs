//! The page: blocks of text, tables, charts and pictures in one HTML file that needs nothing else.

use image::{ExtendedColorType, ImageEncoder, RgbImage, codecs::png::PngEncoder};

use super::chart::Chart;
use super::table::Table;

/// One thing on the page.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// Something that could not be measured, and why.
    Missing {
        /// The figure or the picture.
        what: String,
        /// Why it is missing.
        reason: String,
    },
    /// A table, also written as CSV.
    Table(Table),
    /// A chart, its points also written as CSV.
    Chart(Chart),
    /// A picture with a line below it, enlarged by whole steps already.
    Picture {
        /// The pixels.
        picture: RgbImage,
        /// What it shows.
        caption: String,
    },
}

/// A headed part of the page.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Its heading.
    pub title: String,
    /// Its contents in order.
    pub blocks: Vec<Block>,
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;max-width:72em;margin:2em auto;padding:0 1em;color:#222}\
table{border-collapse:collapse;margin:1em 0;font-size:13px}caption{text-align:left;font-weight:600;padding:.3em 0}\
th,td{border:1px solid #ddd;padding:.2em .55em;text-align:left}td.n{text-align:right;font-variant-numeric:tabular-nums}\
thead{background:#f4f4f4}figure{margin:1em 0}figcaption{font-size:13px;color:#555}img{image-rendering:pixelated;max-width:100%}\
svg{max-width:100%;height:auto}.missing{background:#fff3cd;padding:.4em .7em}";

/// The whole page as HTML.
pub fn to_html(title: &str, parts: &[Part]) -> String {
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\n<style>{STYLE}</style></head>\n<body>\n<h1>{title}</h1>\n",
        title = escape(title),
    );
    for part in parts {
        html += &format!("<h2>{}</h2>\n", escape(&part.title));
        html.extend(part.blocks.iter().map(block_html));
    }
    html + "</body></html>\n"
}

/// Stem and contents of every CSV file that the page links to.
pub fn csv_files(parts: &[Part]) -> Vec<(String, String)> {
    let blocks = parts.iter().flat_map(|p| &p.blocks);
    let table = |block: &Block| match block {
        Block::Table(table) => Some(table.clone()),
        Block::Chart(chart) => Some(chart.to_table()),
        Block::Text(_) | Block::Missing { .. } | Block::Picture { .. } => None,
    };
    blocks
        .filter_map(table)
        .map(|t| (t.file.clone(), t.to_csv()))
        .collect()
}

fn block_html(block: &Block) -> String {
    match block {
        Block::Text(text) => format!("<p>{}</p>\n", escape(text)),
        Block::Missing { what, reason } => {
            format!(
                "<p class=\"missing\">{}: not measured: {}</p>\n",
                escape(what),
                escape(reason)
            )
        }
        Block::Table(table) => table.to_html(),
        Block::Chart(chart) => match chart.to_svg() {
            Ok(svg) => format!(
                "<figure>{svg}<figcaption>{names}<a href=\"{file}.csv\">CSV</a></figcaption></figure>\n",
                names = numbered(&chart.named()),
                file = escape(&chart.file),
            ),
            Err(error) => missing_html(&chart.title, &error),
        },
        Block::Picture { picture, caption } => match data_uri(picture) {
            Ok(uri) => format!(
                "<figure><img src=\"{uri}\" alt=\"{text}\"><figcaption>{text}</figcaption></figure>\n",
                text = escape(caption),
            ),
            Err(error) => missing_html(caption, &error),
        },
    }
}

/// What the numbers in a chart stand for.
fn numbered(names: &[&str]) -> String {
    let item = |(i, name): (usize, &&str)| format!("<b>{}</b> {} \u{b7} ", i + 1, escape(name));
    names.iter().enumerate().map(item).collect()
}

fn missing_html(what: &str, error: &dyn std::error::Error) -> String {
    block_html(&Block::Missing {
        what: what.to_owned(),
        reason: error.to_string(),
    })
}

/// Text made safe between tags and in attributes.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            '"' => safe += "&quot;",
            _ => safe.push(c),
        }
    }
    safe
}

fn data_uri(picture: &RgbImage) -> Result<String, image::ImageError> {
    let mut png = Vec::new();
    let (width, height) = picture.dimensions();
    PngEncoder::new(&mut png).write_image(picture, width, height, ExtendedColorType::Rgb8)?;
    Ok(format!("data:image/png;base64,{}", base64(&png)))
}

/// RFC 4648 base 64 with padding.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * i)) as usize & 63];
            text.push(if i <= chunk.len() {
                char::from(digit)
            } else {
                '='
            });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_agrees_with_the_rfc() {
        let pairs = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ];
        for (plain, coded) in pairs {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        assert_eq!(base64(&[255, 254, 253]), "//79");
    }

    #[test]
    fn a_page_holds_every_block_and_links_nothing_outside() {
        let mut table = Table::new("times", "Times", &["a"]);
        table.row(["1"]);
        let parts = [Part {
            title: "A & B".to_owned(),
            blocks: vec![
                Block::Text("hello".to_owned()),
                Block::Missing {
                    what: "a".to_owned(),
                    reason: "no renderer".to_owned(),
                },
                Block::Table(table),
                Block::Chart(Chart::new("empty", "Empty", "x", "y")),
                Block::Picture {
                    picture: RgbImage::new(2, 2),
                    caption: "dots".to_owned(),
                },
            ],
        }];
        let html = to_html("Report", &parts);
        let expected = [
            "A &amp; B",
            "hello",
            "no renderer",
            "times.csv",
            "no point is positive",
            "data:image/png",
        ];
        for part in expected {
            assert!(html.contains(part), "{part}");
        }
        assert!(!html.contains("http"));
        assert_eq!(
            csv_files(&parts)[0],
            ("times".to_owned(), "a\n1\n".to_owned())
        );
    }
}
