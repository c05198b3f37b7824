//! Query parameters that an operation does not have, or that are sent twice, are refused, as unknown members of a body are: a misspelled
//! filter or `dry_run` would otherwise do something else than its sender means.

use super::error::Error;
use axum::extract::{MatchedPath, Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::Response;
use std::collections::HashMap;
use std::sync::Arc;
use url::form_urlencoded;
use utoipa::openapi::path::{Operation, Parameter, ParameterIn};
use utoipa::openapi::{OpenApi, RefOr};

/// Maximum characters of an unknown parameter's name that an answer repeats.
const MAX_NAME_CHARACTERS: usize = 64;

/// The names of the query parameters of every operation, by path and method.
#[derive(Clone)]
pub(super) struct Parameters(Arc<HashMap<(String, Method), Vec<String>>>);

impl Parameters {
    /// Returns the parameters that the document declares.
    pub fn of(document: &OpenApi) -> Parameters {
        let mut parameters = HashMap::new();
        for (path, item) in &document.paths.paths {
            let operations = [
                (Method::GET, &item.get),
                (Method::PUT, &item.put),
                (Method::POST, &item.post),
                (Method::DELETE, &item.delete),
                (Method::OPTIONS, &item.options),
                (Method::HEAD, &item.head),
                (Method::PATCH, &item.patch),
            ];
            for (method, operation) in operations {
                if let Some(operation) = operation {
                    parameters.insert((path.clone(), method), of_query(operation));
                }
            }
        }
        Parameters(Arc::new(parameters))
    }

    fn of_operation(&self, path: &str, method: &Method) -> Option<&Vec<String>> {
        let find = |method: &Method| self.0.get(&(path.to_owned(), method.clone()));
        find(method).or_else(|| if method == Method::HEAD { find(&Method::GET) } else { None })
    }
}

fn of_query(operation: &Operation) -> Vec<String> {
    let name = |parameter: &RefOr<Parameter>| match parameter {
        RefOr::T(parameter) if parameter.parameter_in == ParameterIn::Query => Some(parameter.name.clone()),
        _ => None,
    };
    operation.parameters.iter().flatten().filter_map(name).collect()
}

/// Middleware that refuses a request with a query parameter that its operation does not have, or with one twice.
pub(super) async fn refuse_unknown(
    State(parameters): State<Parameters>,
    request: Request,
    next: Next,
) -> Result<Response, Error> {
    let path = request.extensions().get::<MatchedPath>().map_or("", MatchedPath::as_str);
    if let Some(query) = request.uri().query()
        && let Some(known) = parameters.of_operation(path, request.method())
    {
        let mut seen = Vec::new();
        for (name, _) in form_urlencoded::parse(query.as_bytes()) {
            if !known.iter().any(|known| *known == name) {
                let name: String = name.chars().take(MAX_NAME_CHARACTERS).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                let detail = format!("the operation has no query parameter `{name}`; it has {known}");
                return Err(Error::InvalidQuery { field: Some(name.into()), detail });
            }
            if seen.contains(&name) {
                let detail = format!("the query has the parameter `{name}` twice");
                return Err(Error::InvalidQuery { field: Some(name.into_owned().into()), detail });
            }
            seen.push(name);
        }
    }
    Ok(next.run(request).await)
}
