//! A server that is killed a hundred times while clients write and jobs run.

use reqwest::Method;
use tempfile::TempDir;
use tokio::sync::mpsc::UnboundedSender;
use viola_testing::client::Client;
use viola_testing::process::Process;
use viola_testing::{room, zips};

const KILLS: usize = 100;

/// Creates homes until the server is gone; sends the path of each that was acknowledged.
async fn write(client: Client, kill: usize, acknowledged: UnboundedSender<String>) {
    for number in 0.. {
        let path = format!("/v1/homes/h-{kill}-{number}");
        match client.request(Method::PUT, &path).send().await {
            Ok(answer) if answer.status() == 201 => drop(acknowledged.send(path)),
            Ok(answer) => panic!("{path}: {}", answer.status()),
            Err(_) => return,
        }
    }
}

#[tokio::test]
async fn a_hundred_kills_lose_nothing_and_need_no_hand() {
    let data = TempDir::new().unwrap();
    let serve = || {
        Process::serve(data.path(), &["--lease-seconds", "1", "--retry-seconds", "0.01", "--models", "none"])
    };
    let (mut written, mut clips) = (Vec::new(), Vec::new());
    for kill in 0..KILLS {
        let server = serve();
        if kill == 0 {
            server.client.make_room("h").await;
        }
        if kill % 20 == 0 {
            let clip = zips::zip(&room::clip(12 + kill as u32));
            clips.push(server.client.add_clip("/v1/homes/h", clip).await);
        }
        let (tell, mut told) = tokio::sync::mpsc::unbounded_channel();
        let writer = tokio::spawn(write(Client::new(server.client.base.clone()), kill, tell));
        for _ in 0..=kill % 7 {
            written.push(told.recv().await.unwrap());
        }
        server.kill();
        writer.await.unwrap();
        while let Ok(path) = told.try_recv() {
            written.push(path);
        }
    }
    let server = serve();
    for path in &written {
        assert_eq!(server.client.get(path).await.status, 200, "{path} was acknowledged");
    }
    for clip in &clips {
        let clip = server.client.settled(clip).await;
        // No kill counts against a clip.
        assert_eq!((&clip["state"], &clip["job"]["attempts"]), (&"aligned".into(), &1.into()), "{clip:#}");
    }
    assert!(written.len() >= KILLS);
}
