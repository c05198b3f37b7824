//! Disjoint groups of numbered things: each thing has a parent in its group, and only a group's root is its own.

/// Returns the root of a thing's group, and shortens the way to it.
pub fn root(parent: &mut [u32], mut at: u32) -> u32 {
    while parent[at as usize] != at {
        let up = parent[parent[at as usize] as usize];
        parent[at as usize] = up;
        at = up;
    }
    at
}

/// Joins the groups of two things; the lower root stays one. Returns false if they were one group.
pub fn join(parent: &mut [u32], a: u32, b: u32) -> bool {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b) as usize] = a.min(b);
    a != b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_has_its_lowest_member_as_root() {
        let mut parent: Vec<u32> = (0..8).collect();
        for (a, b, is_new) in
            [(4, 6, true), (7, 5, true), (6, 5, true), (7, 4, false), (2, 7, true), (1, 1, false)]
        {
            assert_eq!(join(&mut parent, a, b), is_new, "{a} {b}");
        }
        let roots: Vec<u32> = (0..8).map(|at| root(&mut parent, at)).collect();
        assert_eq!(roots, [0, 1, 2, 3, 2, 2, 2, 2]);
    }
}
