//! Connections of peers that have not said who they are: few at a time, so that strangers cost next to nothing.
//!
//! When there are too many the one that has waited longest has to go: idle connections, however many, keep nobody out.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::oneshot;

#[derive(Debug, Default)]
struct Waiting {
    next: u64,
    guests: VecDeque<(u64, oneshot::Sender<()>)>,
}

/// Where connections wait until they have said who they are.
#[derive(Debug)]
pub struct Doorway {
    most: usize,
    waiting: Mutex<Waiting>,
}

/// A place in a doorway, given up when dropped.
#[derive(Debug)]
pub struct Guest {
    doorway: Arc<Doorway>,
    number: u64,
}

/// Tells when a guest has to go.
#[derive(Debug)]
pub struct Displaced(oneshot::Receiver<()>);

impl Doorway {
    /// For at most so many guests, at least one.
    pub fn new(most: usize) -> Arc<Self> {
        Arc::new(Self {
            most: most.max(1),
            waiting: Mutex::default(),
        })
    }

    /// Lets a connection in, and turns out the one that has waited longest if there are too many.
    pub fn enter(self: &Arc<Self>) -> (Guest, Displaced) {
        let (tell, told) = oneshot::channel();
        let mut waiting = self.lock();
        let number = waiting.next;
        waiting.next += 1;
        waiting.guests.push_back((number, tell));
        if waiting.guests.len() > self.most
            && let Some((_, oldest)) = waiting.guests.pop_front()
        {
            // It may have ended by itself just now.
            let _ = oldest.send(());
        }
        let guest = Guest {
            doorway: Arc::clone(self),
            number,
        };
        (guest, Displaced(told))
    }

    /// Guests that wait.
    pub fn guests(&self) -> usize {
        self.lock().guests.len()
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        let mut waiting = self.doorway.lock();
        if let Ok(place) = waiting
            .guests
            .binary_search_by_key(&self.number, |(number, _)| *number)
        {
            waiting.guests.remove(place);
        }
    }
}

impl Displaced {
    /// Completes when the guest has to make room; never if it has left the doorway before.
    pub async fn told(&mut self) {
        if (&mut self.0).await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_guest_makes_room() {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .build()
            .unwrap();
        let doorway = Doorway::new(2);
        let (a, mut a_told) = doorway.enter();
        let (b, mut b_told) = doorway.enter();
        drop(a);
        let (_c, _) = doorway.enter();
        assert_eq!(doorway.guests(), 2);
        let (_d, _) = doorway.enter();
        assert_eq!(doorway.guests(), 2);
        runtime.block_on(async {
            b_told.told().await;
            tokio::select! {
                biased;
                () = a_told.told() => panic!("it had left by itself"),
                () = std::future::ready(()) => {}
            }
        });
        drop(b);
        assert_eq!(doorway.guests(), 2);
    }
}
