use crate::drive::{Theatre, view};
use renderer::config::Choices;
#[test]
#[ignore]
fn diag() {
    let theatre = Theatre::new(&format!(
        "{}{}",
        crate::two_colours::HEAD,
        crate::two_colours::SHEET
    ));
    for (share, v, f, px, py) in [
        (
            0.02f32,
            view([192, 144], [0.1, 0.2, 4.0], [0.0; 3], 40.0),
            12,
            62usize,
            107usize,
        ),
        (
            0.2,
            view([192, 144], [0.1, 0.2, 4.0], [0.0; 3], 40.0),
            0,
            126,
            31,
        ),
        (
            0.05,
            view([192, 144], [0.1, 0.2, 4.0], [0.0; 3], 40.0),
            5,
            46,
            56,
        ),
    ] {
        let c = theatre.stage.world();
        let _ = c;
        theatre.play(
            Choices::default(),
            (share * 192.0 * 144.0) as usize,
            &vec![v; f + 1],
            |frame, _, d| {
                if frame != f {
                    return;
                }
                println!("--- {share} {frame} {px} {py}");
                for y in py - 2..=py + 2 {
                    for x in px - 2..=px + 2 {
                        let g = d.grid();
                        let at = g.at(x, y);
                        let code = d.epi().code_at(x, y);
                        let (w, b) = g.bit(x, y);
                        let p = d.pixels();
                        print!(
                            "{:?}/pi{} {}",
                            if code.is_simple() {
                                format!("{:?}", code.ends())
                            } else {
                                format!("{}", code.0)
                            },
                            d.epi().primary_inner[w] >> b & 1,
                            if d.epi().has_sample[w] >> b & 1 == 1 {
                                format!(
                                    "({:.3} {:.3}: {:.2} {:.2} n{})",
                                    p.x[at], p.y[at], p.rgb[0][at], p.rgb[2][at], p.count[at]
                                )
                            } else {
                                "-".into()
                            }
                        );
                        print!(" [{:.3} {:.3}] | ", d.image()[0][at], d.image()[2][at]);
                    }
                    println!();
                }
            },
        );
    }
}
