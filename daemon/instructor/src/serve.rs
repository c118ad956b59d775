//! The server: connections are taken, bounded and handed to the routes.

use std::{
    collections::HashMap,
    io,
    net::{IpAddr, SocketAddr, TcpListener as StdListener},
    sync::{Arc, Mutex},
    thread,
    time::Duration,
};

use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    service::TowerToHyperService,
};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::{TcpListener, TcpStream},
    runtime::Builder,
    time::{sleep, timeout},
};
use tokio_rustls::TlsAcceptor;

use crate::{
    access::neighbourhood,
    frames::be_nice,
    guard::Ends,
    hub::Hub,
    link, locked,
    options::{InstructorError, InstructorOptions, Limits},
    routes::routes,
    stop::Stop,
    stream::Impatient,
    tls,
};

/// Heads of requests, bytes and lines.
const HEAD_MAX: (usize, usize) = (32 << 10, 64);
/// Time that connections have to end as the server ends.
const ENDS_WITHIN: Duration = Duration::from_secs(1);

/// A server that has its address and serves nothing yet.
pub struct Instructor {
    hub: Arc<Hub>,
    listener: StdListener,
    address: SocketAddr,
    tls: Option<TlsAcceptor>,
}

impl std::fmt::Debug for Instructor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Instructor").field("address", &self.address).finish_non_exhaustive()
    }
}

impl Instructor {
    /// Checks the options, reads certificate and tokens, and takes the address.
    ///
    /// # Errors
    /// Where the options would open the trainer to the network without saying so, a file cannot be used, or the address is taken.
    pub fn bind(options: InstructorOptions) -> Result<Self, InstructorError> {
        if let Some(path) = &options.tokens {
            // A file that cannot be read shall be known now, not as nobody can log in.
            crate::TokenFile::new(path).list()?;
        }
        let hub = Hub::new(options);
        let options = &hub.options;
        options.check(hub.access.tokens())?;
        let tls = options.tls.as_ref().map(tls::acceptor).transpose()?;
        let failed = |error| InstructorError::Bind { address: options.bind, error };
        let listener = StdListener::bind(options.bind).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        Ok(Self { hub: Arc::new(hub), listener, address, tls })
    }

    /// The address that it is served at.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The page's address for a browser on this computer, or elsewhere where it is served to others.
    pub fn url(&self) -> String {
        let scheme = if self.tls.is_some() { "https" } else { "http" };
        match (self.hub.options.names.first(), self.address.ip().is_unspecified()) {
            (Some(name), _) => format!("{scheme}://{name}:{}/", self.address.port()),
            (None, true) => format!("{scheme}://ADDRESS-OF-THIS-COMPUTER:{}/", self.address.port()),
            (None, false) => format!("{scheme}://{}/", self.address),
        }
    }

    /// Serves until `stop` says so; it is asked ten times a second.
    ///
    /// # Errors
    /// Where the system gives no threads.
    pub fn serve(self, stop: impl Fn() -> bool) -> Result<(), InstructorError> {
        let runtime = Builder::new_multi_thread()
            .worker_threads(2)
            .max_blocking_threads(8)
            .thread_name("instructor")
            // The trainer on the same computer comes first.
            .on_thread_start(|| be_nice(5))
            .enable_all()
            .build()
            .map_err(InstructorError::Threads)?;
        let ends = Arc::new(Stop::default());
        let hub = Arc::clone(&self.hub);
        let link = link::spawn(Arc::clone(&hub.link), Arc::clone(&hub) as _, Arc::clone(&ends))
            .map_err(InstructorError::Threads)?;
        let encoder = thread::Builder::new()
            .name("jpeg".to_owned())
            .spawn({
                let hub = Arc::clone(&hub);
                move || hub.frames.encode()
            })
            .map_err(InstructorError::Threads);
        let served = encoder.and_then(|encoder| {
            let served = runtime.block_on(self.run(stop));
            hub.frames.stop();
            // A panic of it was reported as it happened.
            let _ = encoder.join();
            served
        });
        ends.ask();
        hub.link.shut();
        let _ = link.join();
        runtime.shutdown_timeout(ENDS_WITHIN);
        served
    }

    async fn run(self, stop: impl Fn() -> bool) -> Result<(), InstructorError> {
        let Self { hub, listener, address, tls } = self;
        let listener =
            TcpListener::from_std(listener).map_err(|error| InstructorError::Bind { address, error })?;
        let router = routes(&hub);
        let door = Arc::new(Door { limits: hub.options.limits, router, tls, inside: Mutex::default() });
        tokio::spawn(Arc::clone(&hub).keep_access());
        tokio::spawn(Arc::clone(&hub).ask_for_pictures());
        tokio::spawn(Arc::clone(&hub).keep_score());
        tokio::spawn(take(listener, door));
        while !stop() {
            sleep(Duration::from_millis(100)).await;
        }
        Ok(())
    }
}

/// Serves the instructor's page until `stop` says so; it is asked ten times a second.
///
/// # Errors
/// As [`Instructor::bind`] and [`Instructor::serve`].
pub fn serve(options: InstructorOptions, stop: impl Fn() -> bool) -> Result<(), InstructorError> {
    let instructor = Instructor::bind(options)?;
    log::info!("the instructor's page is at {}", instructor.url());
    instructor.serve(stop)
}

/// The way in.
struct Door {
    limits: Limits,
    router: Router,
    tls: Option<TlsAcceptor>,
    /// Connections by address.
    inside: Mutex<HashMap<IpAddr, usize>>,
}

/// A connection that counts until it is dropped.
struct Inside {
    door: Arc<Door>,
    /// The address as it is counted.
    peer: IpAddr,
}

impl Door {
    fn enter(self: &Arc<Self>, peer: IpAddr) -> Option<Inside> {
        let mut inside = locked(&self.inside);
        let all: usize = inside.values().sum();
        let own = inside.get(&peer).copied().unwrap_or(0);
        if all >= self.limits.connections_max || own >= self.limits.connections_of_peer_max {
            return None;
        }
        inside.insert(peer, own + 1);
        Some(Inside { door: Arc::clone(self), peer })
    }
}

impl Drop for Inside {
    fn drop(&mut self) {
        let mut inside = locked(&self.door.inside);
        if let Some(own) = inside.get_mut(&self.peer) {
            *own -= 1;
            if *own == 0 {
                inside.remove(&self.peer);
            }
        }
    }
}

/// Takes connections for ever.
async fn take(listener: TcpListener, door: Arc<Door>) {
    loop {
        let (stream, peer) = match listener.accept().await {
            Ok(taken) => taken,
            Err(error) => {
                // No more files, usually: others end meanwhile.
                log::debug!("a connection could not be taken: {error}");
                sleep(Duration::from_millis(100)).await;
                continue;
            }
        };
        let Some(inside) = door.enter(neighbourhood(peer.ip())) else {
            log::debug!("too many connections: one from {} is refused", peer.ip());
            continue;
        };
        tokio::spawn(async move {
            if let Err(error) = admit(stream, peer.ip().to_canonical(), &inside).await {
                log::debug!("connection from {}: {error}", peer.ip());
            }
        });
    }
}

async fn admit(
    stream: TcpStream,
    peer: IpAddr,
    inside: &Inside,
) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let Door { limits, router, tls, .. } = &*inside.door;
    stream.set_nodelay(true)?;
    let local = stream.local_addr()?;
    let stream = Impatient::new(stream, limits.write_timeout);
    let ends = Ends { peer, local, is_tls: tls.is_some() };
    match tls {
        None => talk(stream, router.clone(), ends, limits).await?,
        Some(tls) => {
            let late = |_| io::Error::from(io::ErrorKind::TimedOut);
            let stream = timeout(limits.head_timeout, tls.accept(stream)).await.map_err(late)??;
            talk(stream, router.clone(), ends, limits).await?;
        }
    }
    Ok(())
}

async fn talk<S>(stream: S, router: Router, ends: Ends, limits: &Limits) -> hyper::Result<()>
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let service = TowerToHyperService::new(router.layer(Extension(ends)));
    http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(limits.head_timeout)
        .max_buf_size(HEAD_MAX.0)
        .max_headers(HEAD_MAX.1)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades()
        .await
}
