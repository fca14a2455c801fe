//! What the display of a trace said on each connection, and what it was answered.

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::path::Path;
use std::time::Duration;

use protocol::ToServer;
use protocol::messages::{Sample, Texel, Triple};
use protocol::session::SceneSize;
use protocol::trace::{Event, Header, Step};

use super::follow::{Follower, News};
use super::open::{Trace, Trouble};

/// One connection of a trace.
#[derive(Default)]
pub(super) struct Script {
    /// What the display said, and when after the connection was made. The scene's own chunks are left out.
    pub(super) sent: VecDeque<(Duration, ToServer)>,
    /// Answers by request: the epoch, by the connection's count.
    pub(super) answers: HashMap<u64, (u32, Sample, Option<Texel>)>,
    /// The epoch that the server had been told of when an answer came.
    pub(super) came: HashMap<u64, u32>,
    /// Triples that were told, with their epoch.
    pub(super) triples: BTreeSet<(u32, Triple)>,
    opened_us: u64,
    /// The last epoch that the server was told of.
    epoch: u32,
}

/// All connections of a trace in which something was answered.
pub(super) struct Scripts {
    pub(super) header: Header,
    pub(super) size: SceneSize,
    /// The scene as it was sent.
    pub(super) encoded: Vec<u8>,
    /// By their numbers.
    pub(super) scripts: Vec<(u32, Script)>,
}

/// Reads all of a trace.
pub(super) fn read(path: &Path) -> Result<Scripts, Trouble> {
    let mut trace = Trace::open(path)?;
    let size = SceneSize::from(&*trace.scene);
    let mut follower = Follower::new(size);
    let mut scripts: HashMap<u32, Script> = HashMap::new();
    let mut pictures = 0;
    while let Some(entry) = trace.next()? {
        match &entry.event {
            Event::Step(Step::Drawn { .. }) => pictures += 1,
            Event::Opened { connection, .. } => {
                let script = Script {
                    opened_us: entry.time_us,
                    ..Script::default()
                };
                scripts.insert(*connection, script);
            }
            _ => {}
        }
        match follower.follow(&entry.event) {
            Some(News::Sent {
                connection,
                message,
            }) => {
                if let Some(script) = scripts.get_mut(&connection) {
                    if let ToServer::Edit { epoch, .. } = &message {
                        script.epoch = *epoch;
                    }
                    let after = Duration::from_micros(entry.time_us - script.opened_us);
                    script.sent.push_back((after, message));
                }
            }
            Some(News::Samples {
                connection,
                epoch,
                samples,
                ..
            }) => {
                if let Some(script) = scripts.get_mut(&connection) {
                    let came = script.epoch;
                    script
                        .came
                        .extend(samples.iter().map(|(s, _)| (s.id, came)));
                    let all = samples.into_iter().map(|(s, t)| (s.id, (epoch, s, t)));
                    script.answers.extend(all);
                }
            }
            Some(News::Triples {
                connection,
                epoch,
                triples,
            }) => {
                if let Some(script) = scripts.get_mut(&connection) {
                    script
                        .triples
                        .extend(triples.into_iter().map(|t| (epoch, t)));
                }
            }
            Some(News::Other(_)) | None => {}
        }
    }
    trace.warn_of_ending(pictures);
    let mut scripts: Vec<_> = scripts
        .into_iter()
        .filter(|(_, script)| !script.answers.is_empty())
        .collect();
    scripts.sort_unstable_by_key(|(connection, _)| *connection);
    if scripts.is_empty() {
        return Err(Trouble::NoAnswers);
    }
    Ok(Scripts {
        header: trace.header,
        size,
        encoded: trace.encoded,
        scripts,
    })
}
