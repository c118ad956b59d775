//! Requests and their answers.

use std::{sync::Arc, time::Instant};

use axum::{
    Extension, Router,
    body::{Bytes, to_bytes},
    extract::{Path, Request, State, WebSocketUpgrade},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    middleware,
    response::{IntoResponse as _, Response},
    routing::{get, post},
};
use bowwave_core::text::toml::TEXT_BYTES_MAX;
use serde::Serialize;
use serde_json::json;
use tokio::sync::OwnedSemaphorePermit;

use crate::{
    access::{LoginError, Visitor},
    assets,
    command::COMMAND_BYTES_MAX,
    daytime::{self, DayTime},
    guard::{Ends, REVIEW_POLICY, guard},
    hub::Hub,
    library::{self, LibraryError, Origin},
    page, score, socket,
};

/// Most bytes of the body of a login.
const LOGIN_BYTES_MAX: usize = 1024;

/// A refusal: its status, and words.
type Refusal = (StatusCode, String);
type Answer = Result<Response, Refusal>;

/// All routes. No path of a request reaches the file system but names of scenarios that were checked.
pub(crate) fn routes(hub: &Arc<Hub>) -> Router {
    Router::new()
        .route("/", get(front))
        .route("/assets/{name}", get(asset))
        .route("/login", post(login))
        .route("/logout", post(logout))
        .route("/ws", get(upgrade))
        .route("/api/runs", get(runs))
        .route("/review/{run}", get(review))
        .route("/api/scenarios", get(scenarios))
        .route("/api/scenarios/{origin}/{name}", get(scenario).put(save))
        .route("/api/check", post(check))
        .route("/api/start/{day}/{name}", post(start))
        .fallback(async || refusal(StatusCode::NOT_FOUND, "there is nothing at this address"))
        .layer(middleware::from_fn_with_state(Arc::clone(hub), guard))
        .with_state(Arc::clone(hub))
}

async fn front() -> Response {
    let kind = (header::CONTENT_TYPE, "text/html; charset=utf-8");
    ([kind, (header::CACHE_CONTROL, "no-cache")], page::html()).into_response()
}

async fn asset(Path(name): Path<String>) -> Answer {
    let asset = assets::find(&name)
        .ok_or_else(|| refusal(StatusCode::NOT_FOUND, "there is no such part of the page"))?;
    let kind = (header::CONTENT_TYPE, asset.kind);
    Ok(([kind, (header::CACHE_CONTROL, "no-cache")], asset.text).into_response())
}

async fn login(State(hub): State<Arc<Hub>>, Extension(ends): Extension<Ends>, request: Request) -> Answer {
    let token = text(request, LOGIN_BYTES_MAX).await?;
    let (cookie, visitor) = hub.access.login(token.trim(), ends.peer, Instant::now()).map_err(|error| {
        let status = match error {
            LoginError::Wrong => StatusCode::UNAUTHORIZED,
            LoginError::TooMany { .. } => StatusCode::TOO_MANY_REQUESTS,
            LoginError::NoRandom => StatusCode::SERVICE_UNAVAILABLE,
        };
        refusal(status, error.to_string())
    })?;
    log::info!("{} logged in from {}", visitor.name, ends.peer);
    let lasts = hub.options.limits.session.as_secs();
    let cookie = set_cookie(ends, &cookie, lasts)?;
    Ok(([(header::SET_COOKIE, cookie)], json(&json!({"name": visitor.name}))).into_response())
}

async fn logout(State(hub): State<Arc<Hub>>, Extension(ends): Extension<Ends>, headers: HeaderMap) -> Answer {
    if let Some(visitor) = visitor(&hub, ends, &headers) {
        if let Some(words) = hub.control.hand_back(&visitor.key) {
            hub.notice(&words);
        }
        hub.access.logout(&visitor.key);
    }
    Ok(([(header::SET_COOKIE, set_cookie(ends, "", 0)?)], json(&json!({}))).into_response())
}

async fn upgrade(
    State(hub): State<Arc<Hub>>,
    Extension(ends): Extension<Ends>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    let visitor = visitor(&hub, ends, &headers);
    upgrade
        .max_message_size(COMMAND_BYTES_MAX)
        .max_frame_size(COMMAND_BYTES_MAX)
        .read_buffer_size(COMMAND_BYTES_MAX)
        .write_buffer_size(COMMAND_BYTES_MAX)
        .on_upgrade(move |socket| socket::serve(socket, hub, visitor))
}

async fn runs(State(hub): State<Arc<Hub>>, Extension(ends): Extension<Ends>, headers: HeaderMap) -> Answer {
    let _ = known(&hub, ends, &headers)?;
    let journal = hub.journal().map_err(not_found)?;
    let permit = Arc::clone(&hub.texts).acquire_owned().await.map_err(gone)?;
    let runs = apart(permit, move || score::runs(&journal)).await?.map_err(not_found)?;
    Ok(json(&runs))
}

async fn review(
    State(hub): State<Arc<Hub>>,
    Extension(ends): Extension<Ends>,
    Path(run): Path<String>,
    headers: HeaderMap,
) -> Answer {
    let _ = known(&hub, ends, &headers)?;
    let run: i64 = run.parse().map_err(|_| refusal(StatusCode::NOT_FOUND, "a run has a number"))?;
    let journal = hub.journal().map_err(not_found)?;
    let permit = Arc::clone(&hub.reviews).acquire_owned().await.map_err(gone)?;
    // Who goes away meanwhile does not free a place for another page before this one is done.
    let made =
        tokio::task::spawn_blocking(move || (score::review(&journal, run), permit)).await.map_err(gone)?;
    let (page, permit) = (made.0.map_err(not_found)?, made.1);
    let body = Bytes::from_owner(HeldPage { page, _permit: permit });
    let kind = (header::CONTENT_TYPE, "text/html; charset=utf-8");
    Ok(([kind, (header::CONTENT_SECURITY_POLICY, REVIEW_POLICY)], body).into_response())
}

/// A page that counts as one in memory until it is sent.
struct HeldPage {
    page: String,
    _permit: OwnedSemaphorePermit,
}

impl AsRef<[u8]> for HeldPage {
    fn as_ref(&self) -> &[u8] {
        self.page.as_bytes()
    }
}

async fn scenarios(
    State(hub): State<Arc<Hub>>,
    Extension(ends): Extension<Ends>,
    headers: HeaderMap,
) -> Answer {
    let _ = known(&hub, ends, &headers)?;
    let permit = Arc::clone(&hub.texts).acquire_owned().await.map_err(gone)?;
    let library = hub.library.clone();
    let list = apart(permit, move || library.list()).await?.map_err(of_library)?;
    Ok(json(&json!({"scenarios": list, "can_save": hub.library.can_save()})))
}

async fn scenario(
    State(hub): State<Arc<Hub>>,
    Extension(ends): Extension<Ends>,
    Path((origin, name)): Path<(String, String)>,
    headers: HeaderMap,
) -> Answer {
    let _ = known(&hub, ends, &headers)?;
    let origin = match origin.as_str() {
        "built-in" => Origin::BuiltIn,
        "own" => Origin::Own,
        _ => return Err(refusal(StatusCode::NOT_FOUND, "scenarios are built-in or own")),
    };
    let library = hub.library.clone();
    let permit = Arc::clone(&hub.texts).acquire_owned().await.map_err(gone)?;
    let text = apart(permit, move || library.text(origin, &name)).await?.map_err(of_library)?;
    Ok(text.into_response())
}

async fn save(
    State(hub): State<Arc<Hub>>,
    Extension(ends): Extension<Ends>,
    Path((origin, name)): Path<(String, String)>,
    request: Request,
) -> Answer {
    let visitor = known(&hub, ends, request.headers())?;
    hub.control.check(Some(&visitor)).map_err(forbidden)?;
    if origin != "own" {
        return Err(refusal(
            StatusCode::FORBIDDEN,
            "built-in scenarios stay as they are: save under your own",
        ));
    }
    let permit = Arc::clone(&hub.texts).acquire_owned().await.map_err(gone)?;
    let text = text(request, TEXT_BYTES_MAX).await?;
    let library = hub.library.clone();
    let saved = name.clone();
    apart(permit, move || library.save(&name, &text)).await?.map_err(of_library)?;
    log::info!("{} saved the scenario {saved}", visitor.name);
    Ok(json(&json!({"saved": saved})))
}

async fn check(State(hub): State<Arc<Hub>>, Extension(ends): Extension<Ends>, request: Request) -> Answer {
    let _ = known(&hub, ends, request.headers())?;
    let text = text(request, TEXT_BYTES_MAX).await?;
    let permit = Arc::clone(&hub.texts).acquire_owned().await.map_err(gone)?;
    Ok(json(&apart(permit, move || library::check(&text)).await?))
}

async fn start(
    State(hub): State<Arc<Hub>>,
    Extension(ends): Extension<Ends>,
    Path((day, name)): Path<(String, String)>,
    request: Request,
) -> Answer {
    let visitor = known(&hub, ends, request.headers())?;
    hub.control.check(Some(&visitor)).map_err(forbidden)?;
    if !library::is_name(&name) {
        return Err(of_library(LibraryError::Name(name)));
    }
    let day: DayTime = serde_json::from_value(day.into())
        .map_err(|_| refusal(StatusCode::NOT_FOUND, "a time of day is written, day, dusk or night"))?;
    let text = text(request, TEXT_BYTES_MAX).await?;
    let permit = Arc::clone(&hub.texts).acquire_owned().await.map_err(gone)?;
    let origin = format!("{name}.toml");
    let named = origin.clone();
    let prepare = move || -> Result<(String, Option<String>), Refusal> {
        let (text, changed) = daytime::at(&text, day).map_err(unsound)?;
        library::may_start(&text, &named).map_err(of_library)?;
        Ok((text, changed))
    };
    let (text, changed) = apart(permit, prepare).await??;
    // Control may have gone to somebody else meanwhile.
    hub.control.check(Some(&visitor)).map_err(forbidden)?;
    hub.begin(origin, text).map_err(|why| refusal(StatusCode::SERVICE_UNAVAILABLE, why))?;
    hub.notice(&format!("{} starts {name}", visitor.name));
    Ok(json(&json!({"changed": changed})))
}

/// Whoever asks, where a session stands behind it.
fn visitor(hub: &Hub, ends: Ends, headers: &HeaderMap) -> Option<Visitor> {
    let name = cookie_name(ends);
    let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    let mut values =
        cookies.flat_map(|value| value.split(';')).filter_map(|pair| pair.trim().split_once('='));
    let (_, cookie) = values.find(|(key, _)| *key == name)?;
    hub.access.visitor(cookie, Instant::now())
}

fn known(hub: &Hub, ends: Ends, headers: &HeaderMap) -> Result<Visitor, Refusal> {
    visitor(hub, ends, headers).ok_or_else(|| refusal(StatusCode::UNAUTHORIZED, "this needs a token: log in"))
}

/// Cookies know no ports: two trainers on one computer have two names.
fn cookie_name(ends: Ends) -> String {
    format!("bowwave_{}", ends.local.port())
}

fn set_cookie(ends: Ends, value: &str, lasts_s: u64) -> Result<HeaderValue, Refusal> {
    let secure = if ends.is_tls { "; Secure" } else { "" };
    let name = cookie_name(ends);
    let cookie = format!("{name}={value}; Path=/; HttpOnly; SameSite=Strict; Max-Age={lasts_s}{secure}");
    cookie.parse().map_err(|_| refusal(StatusCode::INTERNAL_SERVER_ERROR, "a cookie that is none"))
}

/// The body as text.
async fn text(request: Request, bytes_max: usize) -> Result<String, Refusal> {
    let too_long = || refusal(StatusCode::PAYLOAD_TOO_LARGE, format!("{bytes_max} bytes are the most"));
    let bytes = to_bytes(request.into_body(), bytes_max).await.map_err(|_| too_long())?;
    String::from_utf8(bytes.into()).map_err(|_| refusal(StatusCode::BAD_REQUEST, "the text is no UTF-8"))
}

/// Does what may take a while without holding others up.
async fn apart<T: Send + 'static>(
    permit: OwnedSemaphorePermit,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Refusal> {
    // The work goes on where whoever asked is gone, and so does what it counts as.
    let counted = move || {
        let done = work();
        drop(permit);
        done
    };
    let outcome = tokio::task::spawn_blocking(counted).await;
    outcome.map_err(|error| refusal(StatusCode::INTERNAL_SERVER_ERROR, format!("this went wrong: {error}")))
}

fn json(value: &impl Serialize) -> Response {
    let kind: [(HeaderName, &str); 1] = [(header::CONTENT_TYPE, "application/json")];
    // No type here has a map with keys that are no text.
    (kind, serde_json::to_string(value).unwrap_or_default()).into_response()
}

fn refusal(status: StatusCode, why: impl Into<String>) -> Refusal {
    (status, why.into())
}

fn not_found(why: String) -> Refusal {
    refusal(StatusCode::NOT_FOUND, why)
}

fn forbidden(why: String) -> Refusal {
    refusal(StatusCode::FORBIDDEN, why)
}

fn unsound(why: String) -> Refusal {
    refusal(StatusCode::UNPROCESSABLE_ENTITY, why)
}

fn gone<E>(_: E) -> Refusal {
    refusal(StatusCode::SERVICE_UNAVAILABLE, "the server ends")
}

fn of_library(error: LibraryError) -> Refusal {
    let status = match &error {
        LibraryError::Name(_) | LibraryError::Unknown(_) => StatusCode::NOT_FOUND,
        LibraryError::NoFolder | LibraryError::Full => StatusCode::CONFLICT,
        LibraryError::TooLong(_) => StatusCode::PAYLOAD_TOO_LARGE,
        LibraryError::Unsound(_) | LibraryError::Model { .. } => StatusCode::UNPROCESSABLE_ENTITY,
        LibraryError::Io { .. } => StatusCode::INTERNAL_SERVER_ERROR,
    };
    refusal(status, error.to_string())
}
