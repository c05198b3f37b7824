//! The HTTP API: one file per resource; all refusals are in `error`.

mod access;
mod bodies;
mod changes;
mod choice;
mod classes;
mod clip_list;
mod clip_results;
mod clips;
mod compression;
mod connections;
mod content;
mod corrections;
mod digest;
mod digits;
mod documents;
mod error;
mod export;
mod extract;
mod fairness;
mod health;
mod home_events;
mod homes;
mod jobs;
mod layers;
mod lidar_map;
mod lidar_maps;
mod list;
mod map;
mod metrics;
mod names;
mod objects;
mod openapi;
mod origins;
mod page;
mod parameters;
mod peer;
mod problems;
mod ranges;
mod reply;
mod request_headers;
mod request_log;
mod sent_files;
mod server;
mod session;
mod types;
mod uploads;
mod usage;
mod webhooks;

pub use bodies::BodyParams;
pub use clips::recorded_at_of_file;
pub use connections::ConnectionParams;
pub use content::content_sha256;
pub use digits::pretty_json;
pub use fairness::{FailedKeyParams, LimitParams, ReaderParams};
pub use layers::Origin;
pub use map::{objects_document, rooms_document};
pub use server::{ServeError, ServeParams, WorkParams, serve, work};
pub use uploads::{UploadParams, opened_clip_json};

use crate::jobs::Queue;
use crate::webhooks::WebhookParams;
use axum::Router;
use axum::extract::DefaultBodyLimit;
use fairness::{Arrivals, FailedKeys, FairPlaces, Limits, Makers, Readers, Turns};
use parameters::Parameters;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, LazyLock};
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::request_id::{PropagateRequestIdLayer, SetRequestIdLayer};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::{Modify, OpenApi};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use viola_storage::Storage;

/// Maximum size of a JSON body. Files are streamed and have limits of their own.
const MAX_JSON_BYTES: usize = 64 << 10;

/// State shared by all handlers. Every layer clones it for every request.
type App = Arc<Shared>;

struct Shared {
    storage: Arc<Storage>,
    queue: Arc<Queue>,
    max_upload_bytes: u64,
    uploads: UploadParams,
    bodies: BodyParams,
    arrivals: Arrivals,
    limits: Limits,
    turns: Turns,
    failed_keys: FailedKeys,
    /// True if only this machine can reach the listener.
    is_on_loopback: bool,
    webhooks: WebhookParams,
    /// Origins whose pages may call the service.
    cors_origins: Vec<Origin>,
    /// True once a key existed while this process ran: from then on every request needs one.
    has_keys: AtomicBool,
    readers: Readers,
    makers: Makers,
    /// The places of requests that wait for changes, of searches for homes, and of exports.
    waits: FairPlaces,
    searches: FairPlaces,
    exports: FairPlaces,
    /// One export compresses at a time, so that other requests wait for one piece at most.
    compressing: Arc<Semaphore>,
    /// Ends endless answers, such as event streams, when the server stops.
    stop: CancellationToken,
}

/// The security scheme of the OpenAPI document.
struct Security;

impl Modify for Security {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        let bearer = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).description(Some(
            "A key, as `viola keys create` shows it. Until the first key is made, the service asks for none and serves its own machine alone.",
        ));
        let components = document.components.get_or_insert_default();
        components.add_security_scheme("key", SecurityScheme::Http(bearer.build()));
        document.security = Some(vec![SecurityRequirement::new::<_, [&str; 0], &str>("key", [])]);
    }
}

#[derive(OpenApi)]
#[openapi(
    modifiers(&Security),
    components(schemas(error::Problem, types::ClassName, types::HomeEvent, types::JobEvent, types::WebhookMessage, types::WebhookTest,
        map::points::PointFormat, map::scene::PlanFormat, map::mesh::MeshFormat, map::recording::RecordingFormat,
        map::robot::RobotFormat)),
    info(title = "viola", description = "Aligns RGB-D clips of a home to the LiDAR map of its robot vacuum.\n\n\
        Errors are RFC 9457 problem documents with a stable `type`, except those of a head that is too large or not HTTP. Lists page by cursor. A file with an `ETag` \
        and a length serves one range of bytes (`Range`, `If-Range`; RFC 9110, 14)."),
    tags(
        (name = "homes", description = "Homes; each has LiDAR maps and clips"),
        (name = "lidar-map", description = "The maps of the home's robot vacuums, one for each storey"),
        (name = "clips", description = "Recorded RGB-D clips and their poses in the map"),
        (name = "uploads", description = "Clips that arrive in parts, over bad connections: tus 1.0 (https://tus.io)"),
        (name = "map", description = "The fused map of a home"),
        (name = "changes", description = "Feed of the changes of all homes, for backends that keep a copy"),
        (name = "webhooks", description = "Messages about changes to addresses of yours"),
        (name = "jobs", description = "Work under way"),
        (name = "service", description = "The service itself"),
    )
)]
struct Description;

fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(Description::openapi())
        .routes(routes!(homes::list_homes))
        .routes(routes!(homes::get_home, homes::put_home, homes::delete_home))
        .routes(routes!(home_events::watch_home))
        .routes(routes!(lidar_map::get_lidar_map, lidar_map::put_lidar_map))
        .routes(routes!(lidar_map::get_lidar_map_image))
        .routes(routes!(lidar_map::list_lidar_map_revisions))
        .routes(routes!(lidar_maps::list_lidar_maps))
        .routes(routes!(
            lidar_maps::get_level_lidar_map,
            lidar_maps::put_level_lidar_map,
            lidar_maps::delete_level
        ))
        .routes(routes!(lidar_maps::get_level_lidar_map_image))
        .routes(routes!(lidar_maps::list_level_lidar_map_revisions))
        .routes(routes!(lidar_maps::restore_lidar_map))
        .routes(routes!(sent_files::get_lidar_map_file))
        .routes(routes!(clip_list::list_clips, clips::add_clip))
        .routes(routes!(clip_list::list_all_clips))
        .merge(uploads::routes())
        .routes(routes!(clips::get_clip, clips::patch_clip, clips::delete_clip))
        .routes(routes!(clips::align_clip))
        .routes(routes!(choice::choose_alignment, choice::withdraw_alignment))
        .routes(routes!(sent_files::get_clip_recording))
        .routes(routes!(clip_results::get_clip_overlay))
        .routes(routes!(clip_results::get_clip_cloud))
        .routes(routes!(clip_results::get_clip_completion))
        .routes(routes!(clip_results::get_clip_scan))
        .routes(routes!(clip_results::get_clip_thumbnail))
        .routes(routes!(clip_results::get_clip_frames))
        .routes(routes!(map::get_map))
        .routes(routes!(map::list_map_revisions))
        .routes(routes!(map::scene::get_map_plan))
        .routes(routes!(map::scene::get_map_rooms))
        .routes(routes!(map::scene::get_map_objects))
        .routes(routes!(map::scene::get_map_coverage))
        .routes(routes!(map::changes::get_map_changes))
        .routes(routes!(corrections::get_map_object, corrections::correct_map_object))
        .routes(routes!(corrections::get_map_room, corrections::correct_map_room))
        .routes(routes!(corrections::list_map_corrections))
        .routes(routes!(objects::list_objects))
        .routes(routes!(export::export_home))
        .routes(routes!(map::points::get_map_points))
        .routes(routes!(map::mesh::get_map_mesh))
        .routes(routes!(map::recording::get_map_recording))
        .routes(routes!(map::robot::get_map_robot))
        .routes(routes!(changes::list_changes))
        .routes(routes!(webhooks::list_webhooks, webhooks::create_webhook))
        .routes(routes!(webhooks::get_webhook, webhooks::delete_webhook))
        .routes(routes!(webhooks::test_webhook))
        .routes(routes!(webhooks::list_deliveries))
        .routes(routes!(webhooks::retry_delivery))
        .routes(routes!(jobs::list_jobs))
        .routes(routes!(jobs::get_job))
        .routes(routes!(jobs::watch_job))
        .routes(routes!(jobs::cancel_job))
        .routes(routes!(classes::list_classes))
        .routes(routes!(usage::get_usage))
        .routes(routes!(session::get_session))
}

/// Returns the OpenAPI document.
pub fn document() -> &'static utoipa::openapi::OpenApi {
    static DOCUMENT: LazyLock<utoipa::openapi::OpenApi> = LazyLock::new(|| openapi::complete(&described()));
    &DOCUMENT
}

/// Returns the operations as they describe themselves.
fn described() -> utoipa::openapi::OpenApi {
    let mut document = routes().merge(open_routes()).into_openapi();
    document.merge(health::open_routes().merge(health::routes()).into_openapi());
    document
}

/// Returns [`document`] as text, its members always in the same order.
pub fn document_json() -> String {
    let mut text =
        document().to_pretty_json().expect("the document has text keys and cannot fail to serialise");
    text.push('\n');
    text
}

/// Returns the routes of the API that need no key.
fn open_routes() -> OpenApiRouter<App> {
    OpenApiRouter::new().routes(routes!(session::put_session, session::delete_session))
}

/// Returns the router of the second listener, and of a process without the API: health and metrics.
fn health_router(storage: Arc<Storage>) -> Router {
    let (router, _) = health::open_routes().merge(health::routes()).split_for_parts();
    router.fallback(error::no_such_route).with_state(storage)
}

/// Returns the router of the service. With a second listener for operators, this one has no metrics: its keys are those of
/// tenants, and metrics tell of all.
fn router(app: App, has_admin_listener: bool) -> Router {
    let parameters = Parameters::of(&described());
    let refuse_unknown = axum::middleware::from_fn_with_state(parameters, parameters::refuse_unknown);
    let check_headers = axum::middleware::from_fn(request_headers::check);
    let operators = if has_admin_listener { OpenApiRouter::new() } else { health::routes() };
    let health = health::open_routes().split_for_parts().0.with_state(app.storage.clone());
    let cors = layers::cors(&app.cors_origins);
    let allow_origins = |cors| axum::middleware::from_fn_with_state(cors, layers::allow_origins);
    routes()
        .split_for_parts()
        .0
        .merge(operators.split_for_parts().0.with_state(app.storage.clone()))
        .route_layer(check_headers.clone())
        .route_layer(refuse_unknown.clone())
        .route_layer(axum::middleware::from_fn_with_state(app.clone(), access::check))
        .route_layer(axum::middleware::from_fn(uploads::name_version))
        .merge(
            open_routes().split_for_parts().0.route_layer(check_headers).route_layer(refuse_unknown.clone()),
        )
        .merge(health.route_layer(refuse_unknown))
        .merge(documents::routes())
        .merge(page::routes())
        .fallback(error::no_such_route)
        .method_not_allowed_fallback(error::method_not_allowed)
        .layer(DefaultBodyLimit::max(MAX_JSON_BYTES))
        .layer(axum::middleware::from_fn_with_state(app.clone(), origins::check))
        .layer(axum::middleware::from_fn(health::in_time))
        .layer(CatchPanicLayer::custom(error::panicked))
        .layer(axum::middleware::from_fn(metrics::count))
        .layer(axum::middleware::from_fn(reply::tag_documents))
        .layer(axum::middleware::from_fn(ranges::serve_part))
        .layer(compression::compression())
        .layer(axum::middleware::from_fn_with_state(compression::turns(), compression::in_turns))
        .layer(axum::middleware::from_fn(request_log::log))
        .layer(PropagateRequestIdLayer::x_request_id())
        .layer(SetRequestIdLayer::x_request_id(request_log::NewId))
        .layer(axum::middleware::map_request(request_log::drop_harmful_id))
        .layer(tower::util::option_layer(cors.map(allow_origins)))
        .with_state(app)
}
