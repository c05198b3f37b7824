//! Rooms of the plan: pieces of the inside between walls and closed gaps.

mod idle;
mod joined;
mod regions;

use super::cells::Cells;
use super::evidence::Evidence;
use super::faces::Face;
use super::filmed;
use super::gaps::{Gap, gaps};
use super::merges::Merges;
use super::oblique::Oblique;
use super::passages::{MIN_PART_M2, Passage, passages};
use crate::rooms::{Room, RoomSource};
use idle::open_idle;
use joined::{Key, joined};
use regions::{areas, pieces, regions};
use std::collections::BTreeMap;
use viola_geometry::{Point2, Vector2};

/// Smaller pieces are no rooms.
const MIN_AREA_M2: f64 = 1.0;
/// Minimum fraction of a piece that belongs to a given room, for the piece to be a part of it beside the main one.
const OWNED: f64 = 0.5;
/// Spaces on both sides of a wide opening, of a passage between computed rooms, or of an opening that may be beside furniture,
/// are at least this large; smaller ones are alcoves.
const WIDE_AREA_M2: f64 = 4.0;
/// Two rooms may be joined by more than one passage.
const ROUNDS: usize = 3;

/// The plan's rooms, by cell.
pub(super) struct Spaces {
    /// Room of each cell, from 1; 0 outside and in gaps.
    pub of_cell: Vec<u32>,
    /// The given room of each room, by its number from 1; 0 for none. A given room may have several parts.
    pub owners: Vec<u32>,
    /// Room of each cell in a doorway within one room, from 1; else 0.
    pub joins: Vec<u32>,
    pub gaps: Vec<Gap>,
}

impl Spaces {
    /// Rooms of the robot's software divide pieces without a wall between them, and so do those that people named, divided or
    /// merged; other computed ones only at narrow passages. No doorway divides one of the robot's rooms, or a room that people
    /// merged.
    pub fn new(
        cells: &mut Cells,
        evidence: &Evidence,
        faces: &[Face],
        oblique: &[Oblique],
        rooms: &[Room],
        merges: &Merges,
    ) -> Spaces {
        let known = rooms.iter().any(|room| room.source == RoomSource::LidarMap);
        let closed_in = |cells: &Cells| {
            let gaps = gaps(cells, evidence, faces, oblique);
            closed(cells, evidence, gaps, merges)
        };
        let mut closed = closed_in(cells);
        let mut pieces = pieces(cells, &closed);
        let mut found: Vec<Passage> = Vec::new();
        for _ in 0..if known { 0 } else { ROUNDS } {
            let more = passages(cells, &pieces, evidence);
            if more.is_empty() {
                break;
            }
            more.iter().for_each(|passage| passage.refine(cells));
            found.extend(more);
            closed = closed_in(cells);
            closed.extend(found.iter().map(|passage| passage.gap(cells)));
            pieces = regions::pieces(cells, &closed);
        }
        let cells = &*cells;
        let least_m2 = |gap: &Gap| least_m2(gap, cells, evidence);
        open_idle(cells, &mut closed, least_m2);
        let (mut inner, mut dividing): (Vec<Gap>, Vec<Gap>) =
            closed.into_iter().partition(|gap| merges.hold(gap, evidence));
        inner.extend(open_idle(cells, &mut dividing, least_m2));
        inner.retain(|gap| merges.is_doorway(gap, evidence));
        let is_corrected = |room: u32| merges.is_corrected(room);
        let (mut of_cell, owners) = by_owner(cells, &regions::pieces(cells, &dividing), known, is_corrected);
        let mut joins = vec![0; of_cell.len()];
        for at in inner.iter().flat_map(|gap| &gap.cells) {
            joins[*at] = joins[*at].max(std::mem::take(&mut of_cell[*at]));
        }
        dividing.extend(inner);
        Spaces { of_cell, owners, joins, gaps: dividing }
    }
}

/// Returns the minimum floor on both sides of a gap that divides rooms.
fn least_m2(gap: &Gap, cells: &Cells, evidence: &Evidence) -> f64 {
    let is_way = !gap.is_passage && (gap.is_door() || divides_owners(gap, cells));
    let may_be_small = is_way && !is_beside_furniture(gap, cells, evidence);
    if may_be_small { MIN_AREA_M2 } else { WIDE_AREA_M2 }
}

/// Returns those of all gaps, the narrowest first, that may divide rooms or are doorways, without those in the cells of
/// narrower ones.
fn closed(cells: &Cells, evidence: &Evidence, gaps: Vec<Gap>, merges: &Merges) -> Vec<Gap> {
    let mut closed: Vec<Gap> = Vec::new();
    let mut taken = vec![false; cells.inside.len()];
    let is_nothing = |gap: &Gap| merges.hold(gap, evidence) && !merges.is_doorway(gap, evidence);
    for gap in gaps.into_iter().filter(|gap| !is_nothing(gap)) {
        let is_new = gap.cells.iter().any(|at| cells.inside[*at] && !taken[*at]);
        if is_new && (gap.is_door() || gap.is_in_wall() || divides_owners(&gap, cells)) {
            gap.cells.iter().for_each(|at| taken[*at] = true);
            closed.push(gap);
        }
    }
    closed
}

/// Returns whether a gap is within a given room, and no clip saw the wall at its ends, or it is deeper than a wall between
/// rooms: furniture and open leaves of doors look like ends of walls.
fn is_beside_furniture(gap: &Gap, cells: &Cells, evidence: &Evidence) -> bool {
    /// Length of the wall at each end, and minimum fraction of it that clips saw.
    const END_M: f64 = 0.3;
    const FILMED: f64 = 0.5;
    /// Largest thickness of a wall between rooms without a lintel in sight.
    const THICKEST_M: f64 = 0.3;
    let [one, other] = owners_beside(gap, cells);
    let [from, to] = gap.ends_m.map(Point2::from);
    let outward = (to - from).try_normalize(1e-9).map(|along| along * END_M);
    let is_filmed = |outward: Vector2| {
        [(from, -outward), (to, outward)].into_iter().any(|(end, outward)| {
            let ends = [end, end + outward].map(|p| [p.x, p.y]);
            filmed::fraction_between(ends, gap.thickness_m, &[], evidence) >= FILMED
        })
    };
    let is_deep = gap.thickness_m > THICKEST_M && !gap.has_lintel;
    one != 0 && one == other && (is_deep || outward.is_some_and(|outward| !is_filmed(outward)))
}

/// Returns whether different given rooms are on the two sides of a gap.
fn divides_owners(gap: &Gap, cells: &Cells) -> bool {
    let [one, other] = owners_beside(gap, cells);
    one != 0 && other != 0 && one != other
}

/// Returns the given rooms on the two sides of a gap.
fn owners_beside(gap: &Gap, cells: &Cells) -> [u32; 2] {
    let owner = |up: bool| {
        let mut areas: BTreeMap<u32, f64> = BTreeMap::new();
        for at in &gap.beside[usize::from(up)] {
            cells.owners[*at].iter().for_each(|(owner, area)| *areas.entry(*owner).or_default() += area);
        }
        areas.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(owner, _)| owner)
    };
    [false, true].map(owner)
}

/// The given rooms of a piece.
struct Parts {
    rooms: Vec<u32>,
    /// The one that has all other given rooms; without it, the nearest one has them.
    rest: Option<u32>,
}

/// Divides pieces with several given rooms if these `divide`, else between the largest one and corrected ones that have most of
/// their area in the piece. Drops small rooms, and numbers the rest by descending area.
fn by_owner(
    cells: &Cells,
    pieces: &[u32],
    divide: bool,
    is_corrected: impl Fn(u32) -> bool,
) -> (Vec<u32>, Vec<u32>) {
    let areas_m2 = rooms_m2(cells, pieces);
    let mut most_of: BTreeMap<u32, (f64, usize)> = BTreeMap::new();
    for (piece, areas_m2) in areas_m2.iter().enumerate() {
        for (owner, area) in areas_m2 {
            let most = most_of.entry(*owner).or_insert((*area, piece));
            if *area > most.0 {
                *most = (*area, piece);
            }
        }
    }
    let parts = areas_m2.iter().enumerate().map(|(piece, areas_m2)| {
        let is_here = |owner: &u32| most_of.get(owner).is_some_and(|most| most.1 == piece);
        let divides = |owner: &u32| divide || is_corrected(*owner) && is_here(owner);
        let large = areas_m2.iter().filter(|(owner, area)| **area >= MIN_PART_M2 && divides(owner));
        let mut rooms: Vec<u32> = large.map(|(owner, _)| *owner).collect();
        let most = largest(areas_m2);
        if !rooms.contains(&most) {
            rooms.push(most);
        }
        Parts { rooms, rest: (!divide).then_some(most) }
    });
    let mut key = spread(cells, pieces, &parts.collect::<Vec<Parts>>());
    // Another room may lie between the parts of a given one.
    let region = regions(cells, |at| key[at]);
    let region = joined(cells, pieces, &mut key, region);
    let area_m2 = areas(cells, &region);
    let mut order: Vec<usize> = (1..area_m2.len()).filter(|at| area_m2[*at] >= MIN_AREA_M2).collect();
    order.sort_by(|a, b| area_m2[*b].total_cmp(&area_m2[*a]).then(a.cmp(b)));
    let mut number = vec![0; area_m2.len()];
    (1..).zip(&order).for_each(|(next, region)| number[*region] = next);
    let of_cell = region.iter().map(|region| number[*region as usize]).collect();
    (of_cell, owners(cells, &region, &key, &order))
}

/// Returns the area of each given room in each piece, by the piece's number.
fn rooms_m2(cells: &Cells, pieces: &[u32]) -> Vec<BTreeMap<u32, f64>> {
    let count = pieces.iter().max().map_or(0, |most| *most as usize) + 1;
    let mut areas_m2: Vec<BTreeMap<u32, f64>> = vec![BTreeMap::new(); count];
    for (at, piece) in pieces.iter().enumerate().filter(|(_, piece)| **piece != 0) {
        for (owner, area) in cells.owners[at].iter().filter(|(owner, _)| *owner != 0) {
            *areas_m2[*piece as usize].entry(*owner).or_default() += area;
        }
    }
    areas_m2
}

/// Returns the room with the largest area; 0 for none.
fn largest(areas_m2: &BTreeMap<u32, f64>) -> u32 {
    areas_m2.iter().max_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |(owner, _)| *owner)
}

/// Returns the given room of each region in an `order`, 0 for none. `key` has the room of each cell.
fn owners(cells: &Cells, region: &[u32], key: &[Key], order: &[usize]) -> Vec<u32> {
    let (areas_m2, area_m2) = (rooms_m2(cells, region), areas(cells, region));
    let mut owner_of = vec![0; area_m2.len()];
    region.iter().zip(key).for_each(|(region, key)| owner_of[*region as usize] = key.map_or(0, |key| key.1));
    for (owner, areas_m2) in owner_of.iter_mut().zip(&areas_m2) {
        // A room that only corrected ones connect with the largest room is not that one.
        if !areas_m2.contains_key(owner) {
            *owner = largest(areas_m2);
        }
    }
    let owned_m2 = |region: usize| areas_m2[region].get(&owner_of[region]).copied().unwrap_or_default();
    let mut most_m2: BTreeMap<u32, f64> = BTreeMap::new();
    for region in order {
        let most_m2 = most_m2.entry(owner_of[*region]).or_default();
        *most_m2 = most_m2.max(owned_m2(*region));
    }
    // A piece into which a room reaches a little is not a part of it.
    let owner = |region: &usize| {
        let owned_m2 = owned_m2(*region);
        let is_most = most_m2.get(&owner_of[*region]).is_none_or(|most_m2| owned_m2 >= *most_m2);
        if is_most || owned_m2 >= OWNED * area_m2[*region] { owner_of[*region] } else { 0 }
    };
    order.iter().map(owner).collect()
}

/// Gives each cell to one of the `parts` of its piece: its own largest room, or the one that has that, else that of the nearest
/// cell.
fn spread(cells: &Cells, pieces: &[u32], parts: &[Parts]) -> Vec<Key> {
    let owner = |at: usize| {
        let Parts { rooms, rest } = parts.get(pieces[at] as usize)?;
        let own = cells.owners[at].iter().map(|(owner, _)| *owner).find(|owner| *owner != 0);
        let only = || if let [only] = rooms.as_slice() { Some(*only) } else { None };
        own.filter(|own| rooms.contains(own)).or(own.and(*rest)).or_else(only)
    };
    let mut key: Vec<Key> = vec![None; pieces.len()];
    let mut open = std::collections::VecDeque::new();
    for at in (0..pieces.len()).filter(|at| pieces[*at] != 0) {
        key[at] = owner(at).map(|owner| (pieces[at], owner));
        open.extend(key[at].map(|_| at));
    }
    while let Some(at) = open.pop_front() {
        for next in crate::rooms::outline::beside(at, cells.count(0), cells.count(1)).into_iter().flatten() {
            if pieces[next] == pieces[at] && key[next].is_none() {
                key[next] = key[at];
                open.push_back(next);
            }
        }
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One piece of 1 m high cells, by their right sides and given rooms.
    fn divided(cells: &[(f64, u32)]) -> (Vec<u32>, Vec<u32>) {
        divided_by(cells, &vec![1; cells.len()], true, &[])
    }

    fn divided_by(
        cells: &[(f64, u32)],
        pieces: &[u32],
        divide: bool,
        corrected: &[u32],
    ) -> (Vec<u32>, Vec<u32>) {
        let sides = std::iter::once(0.0).chain(cells.iter().map(|(to, _)| *to)).collect();
        let mut all = Cells { inside: vec![true; cells.len()], ..Cells::of([sides, vec![0.0, 1.0]]) };
        for (at, (_, owner)) in cells.iter().enumerate() {
            all.owners[at] = vec![(*owner, all.area_m2(at))];
        }
        by_owner(&all, pieces, divide, |room| corrected.contains(&room))
    }

    #[test]
    fn a_room_that_another_divides_keeps_both_parts() {
        // Room 2 lies between the parts of room 1.
        let (of_cell, owners) = divided(&[(3.0, 1), (5.0, 2), (9.0, 1)]);
        assert_eq!((of_cell, owners), (vec![2, 3, 1], vec![1, 1, 2]));
        // A part that is too small for a room belongs to the room beside it.
        let (of_cell, owners) = divided(&[(3.0, 1), (5.0, 2), (5.5, 1)]);
        assert_eq!((of_cell, owners), (vec![1, 2, 2], vec![1, 2]));
        let (of_cell, owners) = divided(&[(0.5, 1), (1.2, 2), (5.0, 3)]);
        assert_eq!((of_cell, owners), (vec![1, 1, 1], vec![3]));
    }

    #[test]
    fn the_largest_room_has_those_that_nobody_corrected() {
        let cells = [(5.0, 1), (8.0, 2), (12.0, 3)];
        for (corrected, want) in [
            (vec![], (vec![1, 1, 1], vec![1])),
            (vec![1], (vec![1, 1, 1], vec![1])),
            (vec![3], (vec![1, 1, 2], vec![1, 3])),
            (vec![2, 3], (vec![1, 3, 2], vec![1, 3, 2])),
        ] {
            assert_eq!(divided_by(&cells, &[1; 3], false, &corrected), want, "{corrected:?}");
        }
        // All of room 2, not only the half of it that is nearer.
        let cells = [(5.0, 1), (6.0, 2), (7.0, 2), (8.0, 2), (9.0, 2), (12.0, 3)];
        assert_eq!(divided_by(&cells, &[1; 6], false, &[3]), (vec![1, 1, 1, 1, 1, 2], vec![1, 3]));
        // Room 2 is behind room 3.
        let cells = [(5.0, 1), (8.0, 3), (12.0, 2)];
        assert_eq!(divided_by(&cells, &[1; 3], false, &[3]), (vec![1, 3, 2], vec![1, 2, 3]));
        // Most of room 2 is behind a wall.
        let cells = [(5.0, 1), (7.0, 2), (12.0, 2)];
        assert_eq!(divided_by(&cells, &[1, 1, 2], false, &[2]), (vec![1, 1, 2], vec![1, 2]));
    }

    #[test]
    fn a_part_joins_all_beside_it_that_are_one_room() {
        let (of_cell, owners) = divided(&[(3.0, 1), (3.4, 2), (6.4, 1), (9.0, 2)]);
        assert_eq!((of_cell, owners), (vec![1, 1, 1, 2], vec![1, 2]));
    }

    #[test]
    fn a_map_of_very_many_pieces_ends_soon() {
        let strips: Vec<(f64, u32)> = (1..=100_000).map(|at| (f64::from(at) * 1.1, 1)).collect();
        let pieces: Vec<u32> = (1..=100_000).collect();
        let (of_cell, owners) = divided_by(&strips, &pieces, true, &[]);
        assert!(of_cell.iter().all(|room| *room != 0));
        assert!(owners.len() == strips.len() && owners.iter().all(|owner| *owner == 1));
    }

    #[test]
    fn a_map_of_very_many_small_parts_ends_soon() {
        let strips: Vec<(f64, u32)> = (1..=20_000).map(|at| (f64::from(at) * 0.003, 1 + at % 2)).collect();
        let (of_cell, owners) = divided(&strips);
        assert!(of_cell.iter().all(|room| *room != 0), "each part is in a room");
        assert!((1..=60).contains(&owners.len()), "{} rooms of 60 m²", owners.len());
    }
}
