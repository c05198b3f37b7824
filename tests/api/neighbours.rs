//! A clip that its own answer leaves in doubt, and that the clips around it place.

use crate::map::merged;
use crate::server::Server;
use serde_json::json;
use viola::jobs::{Method, align_clip};
use viola_align::{AlignmentState, Alternative};
use viola_formats::clip::Clip;
use viola_geometry::Pose2;
use viola_testing::eventually;

/// Frames of the clip in doubt; other clips keep the method's answer.
const IN_DOUBT: u32 = 20;
/// Probability of each of its two poses, alone.
const ALONE: f64 = 0.48;

/// Runs the real method. The clip in doubt gets a second pose that is as good as the right one.
const LEFT_IN_DOUBT: Method = |clip, map, params, progress| {
    let mut finished = align_clip(clip, map, params, progress)?;
    if Clip::open(clip).unwrap().frames().len() != IN_DOUBT as usize {
        return Ok(finished);
    }
    let alignment = &mut finished.alignment;
    let right = Alternative { probability: Some(ALONE), ..alignment.alternatives[0].clone() };
    let Pose2 { x_m, y_m, yaw_rad } = right.map_from_clip;
    let wrong =
        Alternative { map_from_clip: Pose2::new(x_m + 0.5, y_m + 0.5, yaw_rad + 1.6), ..right.clone() };
    alignment.state = AlignmentState::Ambiguous;
    alignment.probability = Some(ALONE);
    alignment.map_from_clip = Some(wrong.map_from_clip);
    alignment.alternatives = vec![wrong, right];
    Ok(finished)
};

#[tokio::test]
async fn a_clip_that_its_neighbours_place_has_the_probability_of_its_place() {
    let server = Server::with(|params| params.worker.method = LEFT_IN_DOUBT).await;
    let home = server.make_room("h").await;
    let path = server.film(&home, IN_DOUBT).await;
    let alone = server.settled(&path).await;
    assert_eq!((&alone["state"], &alone["placement"]), (&json!("ambiguous"), &json!(null)));
    assert_eq!(alone["alignment"]["probability"], ALONE);

    let sure = [server.film(&home, 24).await, server.film(&home, 22).await];
    merged(&server, &home, &[&path, &sure[0], &sure[1]]).await;
    let placed = server.get(&path).await.ok(200);
    let (answer, placement) = (&placed["alignment"], &placed["placement"]);
    assert_eq!((&placed["state"], &placement["by"]), (&json!("aligned"), &json!("neighbours")), "{placed:#}");
    assert_eq!(placed["reasons"][0]["code"], "decided_by_neighbours");
    assert!(answer["probability"].as_f64().unwrap() >= 0.95, "{answer:#}");
    for member in ["probability", "map_from_clip", "level"] {
        assert_eq!(answer[member], placement[member], "{member}");
    }
    // The second pose was the right one; the method's own list stays.
    assert_eq!(answer["alternatives"], alone["alignment"]["alternatives"]);
    let right = &answer["alternatives"][1]["map_from_clip"];
    let number = |pose: &serde_json::Value, name: &str| pose[name].as_f64().unwrap();
    let off = |name: &str| (number(right, name) - number(&answer["map_from_clip"], name)).abs();
    assert!(off("x_m") < 0.1 && off("y_m") < 0.1 && off("yaw_rad") < 0.05, "{answer:#}");
    let listed = server.get(&format!("{home}/clips?state=aligned")).await.ok(200);
    assert_eq!(listed["items"].as_array().unwrap().len(), 3);
    assert_eq!(listed["items"][0]["alignment"]["probability"], placement["probability"]);

    // Without its neighbours it is in doubt again.
    for clip in sure {
        server.delete(&clip).await.ok(204);
    }
    let again = eventually("the placement ends", || async {
        let clip = server.get(&path).await.ok(200);
        (clip["state"] == "ambiguous").then_some(clip)
    })
    .await;
    assert_eq!((&again["alignment"], &again["placement"]), (&alone["alignment"], &json!(null)));
}
