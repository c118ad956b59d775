//! The way to the trainer: its Unix socket, joined again for ever.

use std::{
    io::{BufReader, BufWriter},
    net::Shutdown,
    os::unix::net::UnixStream,
    path::PathBuf,
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, SyncSender, TrySendError, sync_channel},
    },
    thread,
    time::Duration,
};

use bowwave_core::text::one_line;
use bowwave_link::{
    FromDaemon, Hello, LinkError, Picture, Status, ToDaemon, VERSION, read_from_daemon, write_to_daemon,
};
use serde::Serialize;

use crate::{locked, options::Limits, stop::Stop};

/// Messages that wait for the trainer to take them.
const WAITING_MAX: usize = 16;

/// News of the way to the trainer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct LinkNews {
    /// It is joined.
    pub(crate) joined: bool,
    /// In words.
    pub(crate) words: String,
}

/// Whoever gets what the trainer says.
pub(crate) trait Listener: Send + Sync {
    /// It was joined, or lost.
    fn link(&self, news: LinkNews);
    /// The trainer as it is.
    fn status(&self, status: Status);
    /// Something was refused.
    fn refused(&self, why: String);
    /// A picture.
    fn picture(&self, picture: Picture);
}

/// The way to the trainer.
pub(crate) struct Link {
    path: PathBuf,
    /// Time after which a trainer that says nothing, or takes nothing, is gone.
    silence_max: Duration,
    /// Times between tries to join it.
    tries: (Duration, Duration),
    outgoing: Mutex<Option<SyncSender<ToDaemon>>>,
    stream: Mutex<Option<UnixStream>>,
}

impl Link {
    pub(crate) fn new(path: PathBuf, limits: &Limits) -> Self {
        let Limits { trainer_silence_max: silence_max, trainer_tries: tries, .. } = *limits;
        Self { path, silence_max, tries, outgoing: Mutex::default(), stream: Mutex::default() }
    }

    /// Hands a message to the trainer, or says in words why not. Never waits.
    pub(crate) fn send(&self, message: ToDaemon) -> Result<(), String> {
        let outgoing = locked(&self.outgoing);
        let Some(outgoing) = outgoing.as_ref() else {
            return Err("the trainer is lost, nothing reaches it: wait until it is there again".to_owned());
        };
        outgoing.try_send(message).map_err(|error| match error {
            TrySendError::Full(_) => "the trainer takes nothing at the moment: try again".to_owned(),
            TrySendError::Disconnected(_) => "the trainer was lost just now: try again".to_owned(),
        })
    }

    /// Wakes whoever waits for the trainer, so that it sees that all stops.
    pub(crate) fn shut(&self) {
        if let Some(stream) = locked(&self.stream).as_ref() {
            // One that is shut already is what is wanted.
            let _ = stream.shutdown(Shutdown::Both);
        }
    }

    /// Joins the trainer and listens to it until it is stopped.
    pub(crate) fn run(&self, listener: &dyn Listener, stop: &Stop) {
        let mut wait = self.tries.0;
        while !stop.is_asked() {
            let mut joined = false;
            let ended = self.listen(listener, stop, &mut joined);
            *locked(&self.outgoing) = None;
            *locked(&self.stream) = None;
            if joined {
                log::warn!("the trainer is lost: {}", one_line(&ended));
                wait = self.tries.0;
            }
            listener.link(LinkNews { joined: false, words: ended });
            stop.wait(wait);
            wait = (wait * 2).min(self.tries.1);
        }
    }

    /// Joins the trainer and listens until it is lost: why, in words.
    fn listen(&self, listener: &dyn Listener, stop: &Stop, joined: &mut bool) -> String {
        let path = self.path.display();
        let stream = match UnixStream::connect(&self.path) {
            Ok(stream) => stream,
            Err(error) => {
                return format!("the trainer cannot be reached at {path} ({error}): is it running?");
            }
        };
        match self.talk(stream, listener, stop, joined) {
            Ended::Link(error) => format!("{error}; trying again"),
            Ended::Words(words) => words,
        }
    }

    fn talk(&self, stream: UnixStream, listener: &dyn Listener, stop: &Stop, joined: &mut bool) -> Ended {
        let prepare = || -> std::io::Result<(UnixStream, UnixStream)> {
            stream.set_read_timeout(Some(self.silence_max))?;
            stream.set_write_timeout(Some(self.silence_max))?;
            Ok((stream.try_clone()?, stream.try_clone()?))
        };
        let (kept, writes) = match prepare() {
            Ok(both) => both,
            Err(error) => return Ended::Link(error.into()),
        };
        *locked(&self.stream) = Some(kept);
        if stop.is_asked() {
            return Ended::Words("stopped".to_owned());
        }
        let mut writes = BufWriter::new(writes);
        let hello = ToDaemon::Hello { hello: Hello::new(env!("CARGO_PKG_VERSION")) };
        if let Err(error) = write_to_daemon(&mut writes, &hello) {
            return Ended::Link(error);
        }
        let mut reads = BufReader::with_capacity(1 << 18, &stream);
        let hello = match read_from_daemon(&mut reads) {
            Ok(FromDaemon::Hello(hello)) => hello,
            Ok(FromDaemon::Refused(why)) => return Ended::Words(format!("the trainer refuses: {why}")),
            Ok(_) => {
                return Ended::Words(
                    "the trainer does not greet: install the same version of both".to_owned(),
                );
            }
            Err(error) => return Ended::Link(error),
        };
        if hello.version != VERSION {
            return Ended::Words(format!(
                "the trainer ({}) speaks version {} of the protocol, this program ({}) version {VERSION}: install the same version of both",
                hello.program,
                hello.version,
                env!("CARGO_PKG_VERSION")
            ));
        }
        let (sender, outgoing) = sync_channel(WAITING_MAX);
        *locked(&self.outgoing) = Some(sender);
        *joined = true;
        listener.link(LinkNews { joined: true, words: format!("trainer {}", hello.program) });
        thread::scope(|scope| {
            scope.spawn(move || write_all(writes, &outgoing));
            let error = read_all(&mut reads, listener);
            // The writer ends as it has no more to do, or no socket.
            *locked(&self.outgoing) = None;
            let _ = stream.shutdown(Shutdown::Both);
            Ended::Link(error)
        })
    }
}

enum Ended {
    Link(LinkError),
    Words(String),
}

fn read_all(from: &mut BufReader<&UnixStream>, listener: &dyn Listener) -> LinkError {
    loop {
        match read_from_daemon(from) {
            // Whoever greets twice says nothing new.
            Ok(FromDaemon::Hello(_)) => {}
            Ok(FromDaemon::Status(status)) => listener.status(*status),
            Ok(FromDaemon::Refused(why)) => listener.refused(why),
            Ok(FromDaemon::Picture(picture)) => listener.picture(picture),
            Err(error) => return error,
        }
    }
}

fn write_all(mut to: BufWriter<UnixStream>, outgoing: &Receiver<ToDaemon>) {
    while let Ok(message) = outgoing.recv() {
        if let Err(error) = write_to_daemon(&mut to, &message) {
            log::warn!("to the trainer: {error}");
            // Whoever reads notices it.
            let _ = to.get_ref().shutdown(Shutdown::Both);
            return;
        }
    }
}

/// A thread that keeps the way to the trainer.
pub(crate) fn spawn(
    link: Arc<Link>,
    listener: Arc<dyn Listener>,
    stop: Arc<Stop>,
) -> std::io::Result<thread::JoinHandle<()>> {
    thread::Builder::new().name("link".to_owned()).spawn(move || link.run(&*listener, &stop))
}

#[cfg(test)]
mod tests {
    use std::{io::Write as _, os::unix::net::UnixListener, sync::mpsc};

    use bowwave_link::{read_to_daemon, write_from_daemon};

    use super::*;

    struct Tells(mpsc::Sender<String>);

    impl Listener for Tells {
        fn link(&self, news: LinkNews) {
            let _ = self.0.send(format!("link {} {}", news.joined, news.words));
        }
        fn status(&self, status: Status) {
            let _ = self.0.send(format!("status {}", status.number));
        }
        fn refused(&self, why: String) {
            let _ = self.0.send(format!("refused {why}"));
        }
        fn picture(&self, picture: Picture) {
            let _ = self.0.send(format!("picture {}", picture.frame));
        }
    }

    #[test]
    fn the_trainer_is_joined_again_whatever_it_did() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let (link, stop) = (Arc::new(Link::new(path.clone(), &Limits::default())), Arc::new(Stop::default()));
        let (sender, said) = mpsc::channel();
        let thread = spawn(Arc::clone(&link), Arc::new(Tells(sender)), Arc::clone(&stop)).unwrap();
        let wait = |start: &str| loop {
            let words = said.recv_timeout(Duration::from_secs(20)).unwrap();
            if words.starts_with(start) {
                return words;
            }
        };
        assert!(wait("link false").contains("is it running?"));
        assert!(link.send(ToDaemon::StandBy).unwrap_err().contains("lost"));
        let listener = UnixListener::bind(&path).unwrap();

        // Another version.
        let (mut peer, _) = listener.accept().unwrap();
        assert!(matches!(read_to_daemon(&mut peer).unwrap(), ToDaemon::Hello { .. }));
        write_from_daemon(&mut peer, FromDaemon::Hello(Hello { version: 99, program: "9".into() })).unwrap();
        assert!(wait("link false the trainer (9)").contains("version 99"));

        // Garbage instead of a greeting, and a refusal.
        let (mut peer, _) = listener.accept().unwrap();
        peer.write_all(&[0xff; 64]).unwrap();
        wait("link false");
        let (mut peer, _) = listener.accept().unwrap();
        write_from_daemon(&mut peer, FromDaemon::Refused("one is enough".into())).unwrap();
        assert!(wait("link false the trainer refuses").contains("one is enough"));

        // A sound one, which then says what cannot be.
        let (mut peer, _) = listener.accept().unwrap();
        write_from_daemon(&mut peer, FromDaemon::Hello(Hello::new("1.2.3"))).unwrap();
        assert_eq!(wait("link true"), "link true trainer 1.2.3");
        write_from_daemon(&mut peer, FromDaemon::Status(Box::new(Status { number: 3, ..Status::default() })))
            .unwrap();
        assert_eq!(wait("status"), "status 3");
        link.send(ToDaemon::StandBy).unwrap();
        read_to_daemon(&mut peer).unwrap();
        assert_eq!(read_to_daemon(&mut peer).unwrap(), ToDaemon::StandBy);
        peer.write_all(&[0xff, 0xff, 0xff, 0xff, 1]).unwrap();
        wait("link false");

        let (mut peer, _) = listener.accept().unwrap();
        write_from_daemon(&mut peer, FromDaemon::Hello(Hello::new("1.2.3"))).unwrap();
        wait("link true");
        stop.ask();
        link.shut();
        thread.join().unwrap();
    }
}
