use super::super::footprint::Footprint;
use super::super::members::{Extent, Member, Verdict};
use super::*;
use nalgebra::Matrix3;
use uuid::Uuid;
use viola_geometry::progress::Silent;
use viola_geometry::{LevelName, Pose2};

const EXTENT: Extent = Extent { min_m: [-2.0; 2], max_m: [2.0; 2] };

pub(in crate::assemble) fn member(number: u128, verdict: Verdict) -> Member {
    let name = number.to_string();
    Member {
        clip: Uuid::from_u128(number),
        recorded_at_ms: None,
        sha256: name.clone(),
        contribution: name,
        verdict,
    }
}

pub(in crate::assemble) fn aligned(number: u128, x_m: f64) -> Member {
    let (map_from_clip, covariance) = (Pose2::new(x_m, 0.0, 0.0), Matrix3::identity() * 1e-4);
    member(
        number,
        Verdict::Aligned { level: LevelName::MAIN, map_from_clip, covariance, probability: Some(0.99) },
    )
}

/// A clip that is in one of several rooms, 5 m apart.
fn in_one_of(number: u128, probabilities: &[f64]) -> Member {
    let rooms = probabilities.iter().enumerate();
    let alternatives =
        rooms.map(|(room, probability)| on_main(5.0 * room as f64, 0.0, *probability)).collect();
    member(number, Verdict::Ambiguous { alternatives })
}

pub(in crate::assemble) fn on_main(x_m: f64, yaw_rad: f64, probability: f64) -> Mode {
    Mode { level: LevelName::MAIN, map_from_clip: Pose2::new(x_m, 0.0, yaw_rad), rise_m: 0.0, probability }
}

pub(in crate::assemble) fn candidate(member: &Member) -> Candidate<'_> {
    let modes = super::super::candidates::modes(&member.verdict);
    Candidate { member, modes, extent: EXTENT, footprint: Footprint::default(), points: 1_000 }
}

pub(in crate::assemble) fn marginals(
    candidates: &[Candidate],
    comparisons: &[Comparison],
    forest: &Forest,
) -> Vec<Option<Marginal>> {
    super::marginals(candidates, comparisons, forest, &Silent).unwrap()
}

fn said(a: u128, b: u128, said: &[(u8, u8, [u16; 3])]) -> Comparison {
    let one = |(m, n, [agree, recolored, differ]): &(u8, u8, [u16; 3])| {
        (*m, *n, Agreement { agree: *agree, recolored: *recolored, differ: *differ })
    };
    Comparison { a: a.to_string(), b: b.to_string(), said: said.iter().map(one).collect() }
}

const SAME: [u16; 3] = [60, 2, 0];
const OTHER: [u16; 3] = [5, 5, 80];

/// Members, comparisons, and the expected room of the last clip; none if it stays open.
type Case = (&'static str, Vec<Member>, Vec<Comparison>, Option<usize>);

#[test]
fn all_clips_decide_together() {
    let cases: Vec<Case> = vec![
        ("alone", vec![in_one_of(0, &[0.5, 0.45])], vec![], None),
        (
            "a sure clip contradicts one room",
            vec![aligned(0, 5.0), in_one_of(1, &[0.5, 0.45])],
            vec![said(0, 1, &[(0, 1, OTHER)])],
            Some(0),
        ),
        (
            "agreement alone does not decide",
            vec![aligned(0, 5.0), in_one_of(1, &[0.5, 0.45])],
            vec![said(0, 1, &[(0, 1, SAME)])],
            None,
        ),
        (
            "two open clips that agree in either room",
            vec![in_one_of(0, &[0.5, 0.45]), in_one_of(1, &[0.5, 0.45])],
            vec![said(0, 1, &[(0, 0, SAME), (0, 1, OTHER), (1, 0, OTHER), (1, 1, SAME)])],
            None,
        ),
        (
            "an open clip decides another one, after a sure clip has decided it",
            vec![aligned(0, 0.0), in_one_of(1, &[0.5, 0.49]), in_one_of(2, &[0.5, 0.49])],
            vec![
                said(0, 1, &[(0, 0, OTHER)]),
                said(1, 2, &[(0, 0, OTHER), (0, 1, OTHER), (1, 0, OTHER), (1, 1, SAME)]),
            ],
            Some(1),
        ),
        (
            "contradicted everywhere, it is elsewhere",
            vec![aligned(0, 0.0), in_one_of(1, &[0.5, 0.45])],
            vec![said(0, 1, &[(0, 0, OTHER), (0, 1, OTHER)])],
            None,
        ),
    ];
    for (name, members, comparisons, expected) in cases {
        let candidates: Vec<Candidate> = members.iter().map(candidate).collect();
        let marginals = marginals(&candidates, &comparisons, &Forest::default());
        let last = marginals[marginals.len() - 1].unwrap();
        let room = (last.probability >= super::super::poses::MIN_PLACED_PROBABILITY).then_some(last.mode);
        // A contradicted pair leaves the small chance that the sure clip is wrong.
        let likely = (last.probability > 0.85).then_some(last.mode);
        assert_eq!(expected.and(likely), expected, "{name}: {last:?}");
        assert!(expected.is_some() || room.is_none(), "{name}: {last:?}");
    }
}

#[test]
fn poses_close_together_are_one_explanation() {
    let near = vec![on_main(0.0, 0.0, 0.45), on_main(0.1, 0.02, 0.4), on_main(5.0, 0.0, 0.1)];
    let member = member(0, Verdict::Ambiguous { alternatives: near });
    let found = marginals(&[candidate(&member)], &[], &Forest::default())[0].unwrap();
    assert!(found.mode == 0 && (found.probability - 0.85).abs() < 1e-6, "{found:?}");
}

/// Poses that share no floor are not compared, nor two clips that a person placed.
#[test]
fn only_poses_that_may_meet_are_compared() {
    let chosen = |number, x_m| {
        let map_from_clip = Pose2::new(x_m, 0.0, 0.0);
        member(number, Verdict::Chosen { level: LevelName::MAIN, map_from_clip, rise_m: 0.0 })
    };
    let members = [chosen(0, 0.0), chosen(1, 1.0), in_one_of(2, &[0.5, 0.3, 0.1])];
    let candidates: Vec<Candidate> = members.iter().map(candidate).collect();
    let found = pairs(&candidates);
    let expected = Pairs::from([((0, 2), vec![(0, 0)]), ((1, 2), vec![(0, 0), (0, 1)])]);
    assert_eq!(found, expected);
}

/// A clip that is on one of two levels: a clip of the other level says nothing, whatever it saw.
#[test]
fn poses_on_different_levels_are_not_compared() {
    let upper: LevelName = "upper".parse().unwrap();
    let alternatives = vec![on_main(0.0, 0.0, 0.5), Mode { level: upper, ..on_main(0.0, 0.0, 0.45) }];
    let members = [aligned(0, 0.0), member(1, Verdict::Ambiguous { alternatives })];
    let candidates: Vec<Candidate> = members.iter().map(candidate).collect();
    assert_eq!(pairs(&candidates), Pairs::from([((0, 1), vec![(0, 0)])]));
    // The same pose on another level is another explanation.
    let alone = marginals(&candidates[1..], &[], &Forest::default())[0].unwrap();
    assert!(alone.mode == 0 && (alone.probability - 0.5).abs() < 1e-6, "{alone:?}");
    let contradicted =
        marginals(&candidates, &[said(0, 1, &[(0, 0, OTHER)])], &Forest::default())[1].unwrap();
    assert!(contradicted.mode == 1 && contradicted.probability > 0.85, "{contradicted:?}");
}

/// However many clips agree, and in however many patches.
#[test]
fn agreement_counts_once() {
    let members: Vec<Member> =
        (0..5).map(|number| aligned(number, 0.0)).chain([in_one_of(5, &[0.5, 0.4])]).collect();
    let candidates: Vec<Candidate> = members.iter().map(candidate).collect();
    let trusted = Forest { alike: 3.0, ..Forest::default() };
    let with = |count: u128, patches: [u16; 3]| {
        let comparisons: Vec<Comparison> = (0..count).map(|a| said(a, 5, &[(0, 0, patches)])).collect();
        marginals(&candidates, &comparisons, &trusted)[5].unwrap().probability
    };
    assert!((with(1, [500, 0, 0]) - with(5, [500, 0, 0])).abs() < 0.02);
    assert!(
        with(5, [5_000, 0, 0]) < 0.95 && with(1, SAME) > 0.7,
        "{} {}",
        with(5, [5_000, 0, 0]),
        with(1, SAME)
    );
    // They leave the other alternative.
    assert!(with(2, OTHER) > with(1, OTHER), "contradictions add up");
}

/// A surface that agrees may be that of another room of the map that looks alike, unless a clip saw that room, too.
#[test]
fn agreement_in_rooms_that_look_alike_counts_as_far_as_the_home_tells_them_apart() {
    let check = |probabilities: &[f64], rival: Option<[u16; 3]>, alike: f64, grows: bool| {
        let members = [aligned(0, 0.0), in_one_of(1, probabilities)];
        let candidates: Vec<Candidate> = members.iter().map(candidate).collect();
        let seen: Vec<(u8, u8, [u16; 3])> =
            [Some((0, 0, SAME)), rival.map(|rival| (0, 1, rival))].into_iter().flatten().collect();
        let forest = Forest { alike, ..Forest::default() };
        let found = marginals(&candidates, &[said(0, 1, &seen)], &forest)[1].unwrap();
        assert_eq!(
            found.probability > probabilities[0] + 0.02,
            grows,
            "{probabilities:?} {alike}: {found:?}"
        );
    };
    check(&[0.69, 0.23], None, 0.0, false);
    check(&[0.69, 0.23], None, 2.0, true);
    check(&[0.69, 0.23], Some([4, 0, 0]), 0.0, false);
    check(&[0.69, 0.23], Some([3, 4, 2]), 0.0, true);
    check(&[0.69, 0.10], None, 0.0, true);
    // However many rooms share the probability.
    check(&[0.198, 0.198, 0.003], None, 0.0, false);
    check(&[0.69], None, 0.0, true);
}
