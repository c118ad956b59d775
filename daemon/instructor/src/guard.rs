//! Checks that every request passes, and headers that every answer carries.

use std::{
    net::{IpAddr, SocketAddr},
    sync::Arc,
};

use axum::{
    extract::{Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header, uri::Authority},
    middleware::Next,
    response::{IntoResponse as _, Response},
};

use crate::hub::Hub;

/// Scripts, styles and pictures come from here alone; nothing in a page runs that stands in the page itself.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' blob: data:; \
                      form-action 'self'; base-uri 'none'; frame-ancestors 'none'";
/// A review holds its scripts itself. It runs apart from this page's origin: its scripts can reach neither cookie nor WebSocket.
pub(crate) const REVIEW_POLICY: &str = "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline' data:; style-src 'unsafe-inline'; \
                      img-src data: blob:; media-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

const HEADERS: [(HeaderName, &str); 6] = [
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (HeaderName::from_static("permissions-policy"), "camera=(), microphone=(), geolocation=()"),
];

/// Both ends of a connection.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ends {
    pub(crate) peer: IpAddr,
    pub(crate) local: SocketAddr,
    pub(crate) is_tls: bool,
}

/// Refuses requests that were meant for another host or come from another page, and dresses every answer.
pub(crate) async fn guard(State(hub): State<Arc<Hub>>, request: Request, next: Next) -> Response {
    let limit = hub.options.limits.request_timeout;
    let refused = match request.extensions().get::<Ends>() {
        Some(ends) => check(&request, *ends, &hub.options.names).err(),
        None => Some((StatusCode::INTERNAL_SERVER_ERROR, "a connection without ends")),
    };
    let mut response = match refused {
        Some(refused) => refused.into_response(),
        None => tokio::time::timeout(limit, next.run(request)).await.unwrap_or_else(|_| {
            (StatusCode::REQUEST_TIMEOUT, "the request took too long: try again").into_response()
        }),
    };
    let headers = response.headers_mut();
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(HeaderValue::from_static(POLICY));
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    response
}

fn check(request: &Request, ends: Ends, names: &[String]) -> Result<(), (StatusCode, &'static str)> {
    let headers = request.headers();
    let host = one(headers, header::HOST).ok_or((StatusCode::BAD_REQUEST, "a request without one host"))?;
    let is_other =
        request.uri().authority().is_some_and(|authority| !authority.as_str().eq_ignore_ascii_case(host));
    if is_other || !is_own_host(host, ends, names) {
        return Err((
            StatusCode::MISDIRECTED_REQUEST,
            "this is not the host that was asked for: use the computer's address, or give its name with --name",
        ));
    }
    let changes = !matches!(*request.method(), Method::GET | Method::HEAD);
    let must = changes || headers.contains_key(header::UPGRADE) || headers.contains_key(header::ORIGIN);
    if must && !is_own_origin(headers, host, ends.is_tls) {
        return Err((StatusCode::FORBIDDEN, "another page asks for this: open the instructor's page itself"));
    }
    Ok(())
}

/// The value of a header that is there once.
fn one(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    let mut all = headers.get_all(name).iter();
    let first = all.next()?.to_str().ok()?;
    all.next().is_none().then_some(first)
}

/// Tests whether a host is this computer by an address or a name that nobody else can give it.
fn is_own_host(host: &str, ends: Ends, names: &[String]) -> bool {
    let Ok(authority) = host.parse::<Authority>() else { return false };
    let port = authority.port_u16().unwrap_or(if ends.is_tls { 443 } else { 80 });
    if port != ends.local.port() || host.contains('@') {
        return false;
    }
    let name = authority.host();
    let literal = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    let local = ends.local.ip().to_canonical();
    match literal.parse::<IpAddr>() {
        Ok(address) => address.to_canonical() == local,
        Err(_) if name.eq_ignore_ascii_case("localhost") => local.is_loopback(),
        Err(_) => names.iter().any(|known| known.eq_ignore_ascii_case(name)),
    }
}

fn is_own_origin(headers: &HeaderMap, host: &str, is_tls: bool) -> bool {
    let scheme = if is_tls { "https" } else { "http" };
    one(headers, header::ORIGIN)
        .and_then(|origin| origin.strip_prefix(scheme))
        .and_then(|rest| rest.strip_prefix("://"))
        .is_some_and(|origin| origin.eq_ignore_ascii_case(host))
}

#[cfg(test)]
mod tests {
    use axum::body::Body;
    use proptest::prelude::*;

    use super::*;

    const ENDS: Ends = Ends {
        peer: IpAddr::V4(std::net::Ipv4Addr::new(10, 0, 0, 9)),
        local: SocketAddr::new(IpAddr::V4(std::net::Ipv4Addr::new(10, 0, 0, 1)), 8370),
        is_tls: false,
    };

    #[test]
    fn only_own_hosts_are_answered() {
        let names = ["Gun-1.local".to_owned()];
        let is = |host: &str, ends: Ends| is_own_host(host, ends, &names);
        assert!(is("10.0.0.1:8370", ENDS) && is("gun-1.LOCAL:8370", ENDS));
        for other in [
            "10.0.0.1",
            "10.0.0.1:80",
            "10.0.0.2:8370",
            "localhost:8370",
            "evil.example:8370",
            "10.0.0.1.evil:8370",
            "a@10.0.0.1:8370",
            "",
            ":8370",
            "gun-1.local",
            "[::1]:8370",
            "10.0.0.1:8370/",
            "0x0a000001:8370",
        ] {
            assert!(!is(other, ENDS), "{other}");
        }
        let loopback = Ends { local: "[::1]:443".parse().unwrap(), is_tls: true, ..ENDS };
        assert!(is("[::1]", loopback) && is("localhost", loopback) && !is("127.0.0.1", loopback));
        let mapped = Ends { local: "[::ffff:10.0.0.1]:8370".parse().unwrap(), ..ENDS };
        assert!(is("10.0.0.1:8370", mapped));
    }

    #[test]
    fn other_origins_change_nothing() {
        let ask = |method: &str, origin: &[&str], upgrade: bool| {
            let mut request = Request::builder().method(method).uri("/x").header("host", "10.0.0.1:8370");
            for origin in origin {
                request = request.header("origin", *origin);
            }
            if upgrade {
                request = request.header("upgrade", "websocket");
            }
            check(&request.body(Body::empty()).unwrap(), ENDS, &[]).is_ok()
        };
        let own = "http://10.0.0.1:8370";
        assert!(ask("GET", &[], false) && ask("POST", &[own], false) && ask("GET", &[own], true));
        assert!(!ask("POST", &[], false) && !ask("PUT", &[], false) && !ask("GET", &[], true));
        for other in [
            "null",
            "https://10.0.0.1:8370",
            "http://10.0.0.1",
            "http://evil.example:8370",
            "http://10.0.0.1:8370.evil",
        ] {
            assert!(!ask("POST", &[other], false) && !ask("GET", &[other], false), "{other}");
        }
        assert!(!ask("POST", &[own, "http://evil.example"], false));
    }

    proptest! {
        /// Hosts near the own one, and any others.
        #[test]
        fn no_other_host_is_own(host in "(10\\.0\\.0\\.1|[a-z.\\[\\]@:%0-9]{0,12}|.{0,12})(:8370|:|\\.|@)?[a-z0-9.:]{0,5}") {
            let is_own = host == "10.0.0.1:8370" || host == "10.0.0.1:08370" || host.eq_ignore_ascii_case("[::ffff:10.0.0.1]:8370");
            prop_assert_eq!(is_own_host(&host, ENDS, &[]), is_own, "{}", host);
        }
    }
}
