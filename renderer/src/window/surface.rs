//! The only file that knows how pixels reach the screen.

use std::num::NonZeroU32;
use std::rc::Rc;

use winit::window::Window;

/// A window's pixels.
pub(super) struct Surface {
    surface: softbuffer::Surface<Rc<Window>, Rc<Window>>,
}

impl Surface {
    /// That of a window.
    pub(super) fn new(window: &Rc<Window>) -> Result<Self, softbuffer::SoftBufferError> {
        let context = softbuffer::Context::new(Rc::clone(window))?;
        let surface = softbuffer::Surface::new(&context, Rc::clone(window))?;
        Ok(Self { surface })
    }

    /// Lets `draw` fill `width` x `height` pixels, 0x00RRGGBB row by row, and shows them. A picture without pixels is none.
    pub(super) fn present(
        &mut self,
        width: u32,
        height: u32,
        draw: impl FnOnce(&mut [u32]),
    ) -> Result<(), softbuffer::SoftBufferError> {
        let (Some(w), Some(h)) = (NonZeroU32::new(width), NonZeroU32::new(height)) else {
            return Ok(());
        };
        self.surface.resize(w, h)?;
        let mut buffer = self.surface.buffer_mut()?;
        draw(&mut buffer);
        buffer.present()
    }
}
