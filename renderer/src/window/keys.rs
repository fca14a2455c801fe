//! What keys do.

use winit::keyboard::{Key, KeyCode, NamedKey, PhysicalKey};

use super::controller::Held;
use crate::show::Show;

/// What is done once when a key goes down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command {
    Show(Show),
    Freeze,
    Pause,
    Clear,
    Method,
    /// Which edges of shadows there are.
    Shadows,
    Baseline,
    Home,
    Path,
    Moves,
    Undo,
    Help,
    Screenshot,
    Quit,
    /// Lets go of what is held and puts it back; else the same as quit.
    Escape,
}

/// The list of keys, for people.
pub(super) const HELP: [&str; 30] = [
    "left drag        turn round the target",
    "right drag       move sideways (middle too)",
    "wheel            nearer, farther",
    "W A S D Q E      fly; shift: faster",
    "arrows           look round",
    "Home             back to the scene's camera",
    "P                play or stop the path",
    "",
    "shift left drag  move what is there along the",
    "                   screen; ctrl too: level",
    "U                put it back (ctrl-Z too)",
    "O                play what moves, one by one",
    "",
    "1                picture",
    "2                edges",
    "3                pixel classes",
    "4                points alone",
    "5                priorities",
    "6                samples a pixel",
    "",
    "M                method: edges, without the",
    "                   complex filter, points only",
    "B                borders of shadows: chosen,",
    "                   all, none",
    "R                every pixel ray-traced",
    "F                freeze the points",
    "C                forget the points",
    "space            pause shading",
    "F12              screenshot (ctrl-S too)",
    "H  this list     Esc  quit (ctrl-Q too)",
];

/// What a key moves while it is held: by place on the keyboard, whatever the layout.
pub(super) fn held(key: PhysicalKey) -> Option<Held> {
    let PhysicalKey::Code(code) = key else {
        return None;
    };
    Some(match code {
        KeyCode::KeyW => Held::Forward,
        KeyCode::KeyS => Held::Back,
        KeyCode::KeyA => Held::Left,
        KeyCode::KeyD => Held::Right,
        KeyCode::KeyE => Held::Up,
        KeyCode::KeyQ => Held::Down,
        KeyCode::ArrowLeft => Held::LookLeft,
        KeyCode::ArrowRight => Held::LookRight,
        KeyCode::ArrowUp => Held::LookUp,
        KeyCode::ArrowDown => Held::LookDown,
        KeyCode::ShiftLeft | KeyCode::ShiftRight => Held::Fast,
        _ => return None,
    })
}

/// What a key does: by its letter, and digits also by place, since some layouts have them behind shift.
pub(super) fn command(physical: PhysicalKey, logical: &Key, control: bool) -> Option<Command> {
    let letter = match logical {
        Key::Named(named) => {
            return Some(match named {
                NamedKey::Home => Command::Home,
                NamedKey::Space => Command::Pause,
                NamedKey::Escape => Command::Escape,
                NamedKey::F12 => Command::Screenshot,
                _ => return None,
            });
        }
        Key::Character(text) => text.chars().next().map(|c| c.to_ascii_lowercase()),
        Key::Unidentified(_) | Key::Dead(_) => None,
    };
    if control {
        return match letter? {
            's' => Some(Command::Screenshot),
            'z' => Some(Command::Undo),
            'q' => Some(Command::Quit),
            _ => None,
        };
    }
    let digit = match physical {
        PhysicalKey::Code(KeyCode::Digit1) => Some(1),
        PhysicalKey::Code(KeyCode::Digit2) => Some(2),
        PhysicalKey::Code(KeyCode::Digit3) => Some(3),
        PhysicalKey::Code(KeyCode::Digit4) => Some(4),
        PhysicalKey::Code(KeyCode::Digit5) => Some(5),
        PhysicalKey::Code(KeyCode::Digit6) => Some(6),
        _ => letter.and_then(|c| c.to_digit(10)),
    };
    if let Some(digit) = digit {
        let stage = Show::ALL.get((digit as usize).checked_sub(1)?)?;
        return Some(Command::Show(*stage));
    }
    Some(match letter? {
        'f' => Command::Freeze,
        'c' => Command::Clear,
        'm' => Command::Method,
        'b' => Command::Shadows,
        'r' => Command::Baseline,
        'p' => Command::Path,
        'o' => Command::Moves,
        'u' => Command::Undo,
        'h' | '?' => Command::Help,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn typed(text: &str, control: bool) -> Option<Command> {
        let unknown = PhysicalKey::Unidentified(winit::keyboard::NativeKeyCode::Unidentified);
        command(unknown, &Key::Character(text.into()), control)
    }

    #[test]
    fn letters_digits_and_control_are_told_apart() {
        assert_eq!(typed("F", false), Some(Command::Freeze));
        assert_eq!(typed("1", false), Some(Command::Show(Show::Picture)));
        assert_eq!(typed("6", false), Some(Command::Show(Show::Counts)));
        assert_eq!([typed("0", false), typed("7", false)], [None; 2]);
        assert_eq!(typed("s", false), None);
        assert_eq!(typed("s", true), Some(Command::Screenshot));
        assert_eq!(typed("f", true), None);
        let two = PhysicalKey::Code(KeyCode::Digit2);
        let shifted = Key::Character("\u{e9}".into());
        assert_eq!(
            command(two, &shifted, false),
            Some(Command::Show(Show::Edges))
        );
    }

    #[test]
    fn no_key_both_moves_and_commands() {
        for key in ["w", "a", "s", "d", "q", "e"] {
            assert_eq!(typed(key, false), None, "{key}");
        }
        assert_eq!(held(PhysicalKey::Code(KeyCode::KeyW)), Some(Held::Forward));
        assert_eq!(held(PhysicalKey::Code(KeyCode::KeyF)), None);
    }
}
