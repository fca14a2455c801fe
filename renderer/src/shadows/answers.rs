//! Answers of the thread that computes shadow edges, in its order or in that of another run.

use std::collections::VecDeque;

use super::worker::{Answer, Worker};

/// Answers as they come.
#[derive(Default)]
pub(super) struct Answers {
    /// Those taken last: the job's number, and whether it was the last of the job.
    pub(super) taken: Vec<(u64, bool)>,
    /// Jobs that have ended here before they did in the run that is followed.
    pub(super) ended: Vec<u64>,
    /// Those that came before their turn.
    early: VecDeque<(u64, Answer)>,
    /// Last answers of jobs that came.
    lasts: u64,
}

impl Answers {
    /// The next one in the thread's order.
    pub(super) fn next(&mut self, worker: Option<&Worker>, wait: bool) -> Option<(u64, Answer)> {
        match self.early.pop_front() {
            Some(answer) => Some(answer),
            None => self.come(worker, wait),
        }
    }

    /// The next one of a job, after waiting for it; nothing if the job has ended, or there is none of that number among
    /// those given out.
    pub(super) fn next_of(
        &mut self,
        worker: Option<&Worker>,
        given: u64,
        job: u64,
    ) -> Option<Answer> {
        if self.ended.contains(&job) {
            return None;
        }
        if let Some(place) = self.early.iter().position(|(of, _)| *of == job) {
            return self.early.remove(place).map(|(_, answer)| answer);
        }
        while self.lasts < given {
            let (of, answer) = self.come(worker, true)?;
            if of == job {
                return Some(answer);
            }
            self.early.push_back((of, answer));
        }
        None
    }

    fn come(&mut self, worker: Option<&Worker>, wait: bool) -> Option<(u64, Answer)> {
        let (job, answer) = worker?.answer(wait)?;
        self.lasts += u64::from(answer.is_last());
        Some((job, answer))
    }

    /// Forgets which jobs ended before their turn, and says how many.
    pub(super) fn forget_ended(&mut self) -> usize {
        let ended = self.ended.len();
        self.ended.clear();
        ended
    }
}
