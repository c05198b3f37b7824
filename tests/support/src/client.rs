//! A client that talks to a server as an app would.

use crate::{eventually, room, zips};
use reqwest::{Method, Response};
use serde_json::Value;

/// A server's address and a connection to it.
#[derive(Clone)]
pub struct Client {
    pub base: String,
    pub http: reqwest::Client,
}

/// An answer, read to its end.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    pub headers: reqwest::header::HeaderMap,
    pub bytes: Vec<u8>,
}

impl Answer {
    pub fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().unwrap())
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.bytes)
            .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&self.bytes)))
    }

    /// Checks the status and returns the body.
    pub fn ok(self, status: u16) -> Value {
        assert_eq!(self.status, status, "{}", String::from_utf8_lossy(&self.bytes));
        if self.bytes.is_empty() { Value::Null } else { self.json() }
    }

    /// Checks that this is a problem document in every respect, and returns it.
    pub fn problem(self, status: u16, code: &str) -> Value {
        let text = String::from_utf8_lossy(&self.bytes).into_owned();
        assert_eq!(self.status, status, "{text}");
        assert_eq!(self.header("content-type"), "application/problem+json", "{text}");
        assert!(!self.header("x-request-id").is_empty());
        let problem = self.json();
        assert_eq!(problem["type"], format!("urn:viola:problem:{code}"), "{text}");
        assert_eq!(problem["status"], status, "{text}");
        assert!(problem["title"].as_str().is_some_and(|title| !title.is_empty()), "{text}");
        assert!(problem["detail"].as_str().is_some_and(|detail| !detail.is_empty()), "{text}");
        problem
    }
}

/// Returns the id at the end of the path of a resource.
pub fn id_of(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

impl Client {
    pub fn new(base: String) -> Client {
        // The first call installs it; later ones find it.
        let _ = rustls::crypto::ring::default_provider().install_default();
        // A proxy of the environment does not reach the servers of the tests.
        Client { base, http: reqwest::Client::builder().no_proxy().build().unwrap() }
    }

    pub fn request(&self, method: Method, path: &str) -> reqwest::RequestBuilder {
        self.http.request(method, format!("{}{path}", self.base))
    }

    pub async fn read(response: Response) -> Answer {
        Answer {
            status: response.status().as_u16(),
            headers: response.headers().clone(),
            bytes: response.bytes().await.unwrap().to_vec(),
        }
    }

    pub async fn send(&self, request: reqwest::RequestBuilder) -> Answer {
        Client::read(request.send().await.unwrap()).await
    }

    pub async fn get(&self, path: &str) -> Answer {
        self.send(self.request(Method::GET, path)).await
    }

    /// Opens a stream of events, after the one that the client has seen.
    pub async fn watch(&self, path: &str, seen: Option<&str>) -> Response {
        let mut request = self.request(Method::GET, path);
        if let Some(seen) = seen {
            request = request.header("Last-Event-ID", seen);
        }
        request.send().await.unwrap()
    }

    /// Reads a path with one more header.
    pub async fn get_with(&self, path: &str, header: &str, value: &str) -> Answer {
        self.send(self.request(Method::GET, path).header(header, value)).await
    }

    /// Sends a JSON body.
    pub async fn send_json(&self, method: Method, path: &str, body: &Value) -> Answer {
        self.send(self.request(method, path).json(body)).await
    }

    /// Returns the ids of a list's page, in its order.
    pub async fn ids(&self, list: &str) -> Vec<String> {
        let page = self.get(list).await.ok(200);
        page["items"].as_array().unwrap().iter().map(|item| item["id"].as_str().unwrap().to_owned()).collect()
    }

    pub async fn delete(&self, path: &str) -> Answer {
        self.send(self.request(Method::DELETE, path)).await
    }

    pub async fn post(&self, path: &str, body: impl Into<reqwest::Body>) -> Answer {
        self.send(self.request(Method::POST, path).body(body)).await
    }

    pub async fn put(&self, path: &str, body: impl Into<reqwest::Body>) -> Answer {
        self.send(self.request(Method::PUT, path).body(body)).await
    }

    pub async fn make_home(&self, id: &str) -> String {
        let answer = self.put(&format!("/v1/homes/{id}"), "").await;
        assert!(answer.status == 200 || answer.status == 201, "{answer:?}");
        format!("/v1/homes/{id}")
    }

    /// Creates a home with the LiDAR map of [`room`].
    pub async fn make_room(&self, id: &str) -> String {
        let home = self.make_home(id).await;
        self.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
        home
    }

    /// Adds a clip to a home; returns its path.
    pub async fn add_clip(&self, home: &str, file: Vec<u8>) -> String {
        let answer = self.post(&format!("{home}/clips"), file).await;
        let path = answer.header("location").to_owned();
        answer.ok(201);
        path
    }

    /// Adds a clip of [`room`] with this number of frames; returns its path.
    pub async fn film(&self, home: &str, frames: u32) -> String {
        self.add_clip(home, zips::zip(&room::clip(frames))).await
    }

    /// Returns the path of a clip's job.
    pub async fn job_of(&self, clip: &str) -> String {
        format!("/v1/jobs/{}", self.get(clip).await.ok(200)["job"]["id"].as_str().unwrap())
    }

    /// Returns the clip once its job has ended.
    pub async fn settled(&self, clip: &str) -> Value {
        eventually("the clip is settled", || async {
            let answer = self.get(clip).await;
            // A busy machine may answer so, and asks for another try.
            if answer.status == 503 {
                return None;
            }
            let clip = answer.ok(200);
            let under_way = ["queued", "aligning"].contains(&clip["state"].as_str().unwrap());
            (!under_way).then_some(clip)
        })
        .await
    }

    pub async fn lives(&self) {
        assert_eq!(self.get("/healthz").await.ok(200)["status"], "ok");
    }
}
