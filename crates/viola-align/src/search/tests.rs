//! Tests of the search against all poses.

use super::*;
use proptest::prelude::*;
use viola_geometry::progress::Silent;
use viola_geometry::{DistanceField, Grid, GridFrame, Vector2};

fn target(walls: &[(usize, usize)]) -> Target {
    let frame = GridFrame { origin_m: [-1.0, 0.5], cell_m: 0.05, width: 56, height: 50 };
    let mut occupied = Grid::filled(frame, false);
    for &(x, y) in walls {
        occupied.set(20 + x % 16, 20 + y % 10, true);
    }
    let points_m: Vec<Point2> = walls.iter().map(|&(x, y)| frame.centre(20 + x % 16, 20 + y % 10)).collect();
    // The walls lie on a frame of their own, wider than the one around the points.
    let mut target = Target::from_points(points_m.clone(), Some(0.05), None).unwrap();
    target.field = DistanceField::new(&occupied);
    target.thinned_m = points_m;
    target.points_m = Vec::new();
    target
}

fn hit(x: f64, y: f64) -> Hit {
    Hit::standing(Point2::new(x, y), Vector2::x())
}

fn small() -> SearchParams {
    let first = SearchLimits { modes: 1, min_score_ratio: 0.8 };
    SearchParams { rotations: 24, levels: 3, first, ..SearchParams::default() }
}

fn search(hits: &[Hit], target: &Target, params: &SearchParams) -> Modes {
    Search::new(hits, target, params).run(&params.first, &Silent).unwrap()
}

/// Returns the best score over every rotation and cell, without a pyramid.
fn brute_force(hits: &[Hit], target: &Target, params: &SearchParams) -> f64 {
    let likelihood = Likelihood::new(target, reach_m(hits), params);
    let space = Space::new(&about(&pivot(hits), hits), Arc::new(likelihood), params);
    let roots = space.roots();
    let side = 1i32 << params.levels;
    let leaves = roots.iter().flat_map(|root| {
        (0..side * side).map(|i| space.node(root.rotation, 0, root.x + i % side, root.y + i / side))
    });
    leaves.map(|leaf| space.fraction(leaf.bound)).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn finds_what_brute_force_finds(
        walls in prop::collection::vec((0usize..16, 0usize..10), 5..30),
        points in prop::collection::vec((-0.6..0.6f64, -0.6..0.6f64), 3..25),
    ) {
        let target = target(&walls);
        let hits: Vec<Hit> = points.iter().map(|&(x, y)| hit(x, y)).collect();
        let found = search(&hits, &target, &small());
        let best = found.modes.first().map_or(0.0, |mode| mode.score);
        prop_assert_eq!(best, brute_force(&hits, &target, &small()));
        prop_assert!(found.open_bound <= best);
    }

    #[test]
    fn the_order_of_hits_does_not_matter(points in prop::collection::vec((-0.6..0.6f64, -0.6..0.6f64), 3..25)) {
        let target = target(&[(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (9, 7)]);
        let params = SearchParams { first: SearchLimits { modes: 10, min_score_ratio: 0.8 }, ..small() };
        let hits: Vec<Hit> = points.iter().map(|&(x, y)| hit(x, y)).collect();
        let mut turned = hits.clone();
        turned.reverse();
        prop_assert_eq!(
            search(&hits, &target, &params),
            search(&turned, &target, &params)
        );
    }

    #[test]
    fn a_search_that_goes_on_finds_what_one_that_never_paused_does(
        walls in prop::collection::vec((0usize..16, 0usize..10), 5..30),
        points in prop::collection::vec((-0.6..0.6f64, -0.6..0.6f64), 3..25),
    ) {
        let target = target(&walls);
        let params = SearchParams { resumed: SearchLimits { modes: 12, min_score_ratio: 0.5 }, ..small() };
        let hits: Vec<Hit> = points.iter().map(|&(x, y)| hit(x, y)).collect();
        let mut paused = Search::new(&hits, &target, &params);
        paused.run(&params.first, &Silent).unwrap();
        let mut straight = Search::new(&hits, &target, &params);
        prop_assert_eq!(
            paused.run(&params.resumed, &Silent).unwrap(),
            straight.run(&params.resumed, &Silent).unwrap()
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_search_down_to_a_score_finds_the_modes_that_reach_it(
        walls in prop::collection::vec((0usize..16, 0usize..10), 5..30),
        points in prop::collection::vec((-0.6..0.6f64, -0.6..0.6f64), 3..25),
    ) {
        let target = target(&walls);
        let params = SearchParams { resumed: SearchLimits { modes: 12, min_score_ratio: 0.5 }, ..small() };
        let hits: Vec<Hit> = points.iter().map(|&(x, y)| hit(x, y)).collect();
        let all = Search::new(&hits, &target, &params).run(&params.resumed, &Silent).unwrap();
        let least = 0.8 * all.modes[0].score;
        let likelihood = Arc::new(Likelihood::new(&target, reach_m(&hits) + 0.5, &params));
        let mut search = Search::sharing(&likelihood, &hits, &params);
        prop_assert!(search.known_score() <= all.modes[0].score);
        search.run_down_to(all.modes[0].score, 12, &Silent).unwrap();
        search.drop_below(least);
        let found = search.run_down_to(least, 12, &Silent).unwrap();
        let wanted: Vec<Candidate> = all.modes.into_iter().filter(|mode| mode.score >= least).collect();
        prop_assert_eq!(found.modes, wanted);
    }
}

/// The searches above several floors share the likelihood of a level.
#[test]
fn a_likelihood_for_a_larger_reach_is_shared_and_changes_no_bit() {
    let target = target(&[(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (9, 7)]);
    let params = SearchParams { first: SearchLimits { modes: 10, min_score_ratio: 0.8 }, ..small() };
    let hits: Vec<Hit> = (0..16).map(|i| hit(0.05 * f64::from(i % 4), 0.07 * f64::from(i / 4))).collect();
    let alone = search(&hits, &target, &params);
    for more_m in [0.0, 0.4, 7.0, 1e5] {
        let likelihood = Arc::new(Likelihood::new(&target, reach_m(&hits) + more_m, &params));
        let mut shared = Search::sharing_as_fine(&likelihood, &hits, &target, &params);
        assert_eq!(Arc::strong_count(&likelihood), 2, "{more_m}");
        assert_eq!(shared.run(&params.first, &Silent).unwrap(), alone, "{more_m}");
    }
}

/// The same room is found from outside of the map, wherever the clip begins.
#[test]
fn a_clip_that_begins_outside_of_the_map_is_found() {
    let walls: Vec<(usize, usize)> =
        (0..16).map(|x| (x, 0)).chain((0..10).map(|y| (0, y))).chain((4..9).map(|x| (x, 9))).collect();
    let target = target(&walls);
    let params = SearchParams { rotations: 360, ..small() };
    for [x, y] in [[3.0, 0.0], [-3.0, 0.5], [0.0, 3.0], [0.2, -3.0]] {
        let map_from_clip = Pose2::new(x, y, 0.7);
        let clip_from_map = map_from_clip.inverse();
        let seen = |point: &Point2| {
            let point = clip_from_map.apply(point);
            hit(point.x, point.y)
        };
        let hits: Vec<Hit> = target.thinned_m.iter().map(seen).collect();
        let found = search(&hits, &target, &params).modes[0];
        // Of a room of 0.8 m: a turn by 5 degrees is hardly seen.
        let middle = Point2::new(0.4, 1.75);
        let off_m = (found.map_from_clip.apply(&clip_from_map.apply(&middle)) - middle).norm();
        assert!(found.score > 0.9 && off_m < 0.1, "{x} {y} {found:?} {off_m}");
    }
}

/// Hits beyond the map cost the same score everywhere.
#[test]
fn hits_far_away_change_no_mode() {
    let target = target(&[(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (9, 7)]);
    let params = SearchParams { first: SearchLimits { modes: 10, min_score_ratio: 0.8 }, ..small() };
    let mut hits: Vec<Hit> = (0..16).map(|i| hit(0.05 * f64::from(i % 4), 0.05 * f64::from(i / 4))).collect();
    let alone = search(&hits, &target, &params);
    hits.extend((0..16).map(|i| hit(9e4 - f64::from(i), 40.0 * f64::from(i) - 500.0)));
    let with_far_hits = search(&hits, &target, &params);
    assert_eq!(with_far_hits.nodes, alone.nodes);
    let poses = |found: &Modes| found.modes.iter().map(|mode| mode.map_from_clip).collect::<Vec<_>>();
    assert_eq!(poses(&with_far_hits), poses(&alone));
    assert_eq!(with_far_hits.modes[0].score, alone.modes[0].score / 2.0);
}

#[test]
fn a_budget_ends_the_search_and_says_so() {
    let target = target(&[(0, 0), (5, 3), (9, 7), (12, 1)]);
    let hits: Vec<Hit> = (0..12).map(|i| hit(0.1 * f64::from(i) - 0.6, 0.05 * f64::from(i % 5))).collect();
    let found = search(&hits, &target, &SearchParams { max_nodes: 128, ..small() });
    assert!(found.nodes <= 256);
    assert!(!found.complete && found.modes.len() == 1, "{found:?}");
    assert!(found.open_bound >= found.modes[0].score, "{found:?}");
}
