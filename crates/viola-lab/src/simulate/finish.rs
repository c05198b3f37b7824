//! Appearance of surfaces.

use super::rng::{Rng, hash, unit};

/// A procedural texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pattern {
    Plain,
    /// Fine grain, as of plaster or cloth.
    Grain,
    /// Boards along local x.
    Planks,
    /// Square tiles with joints.
    Tiles,
    /// Upright stripes, as of curtains and panelled fronts.
    Stripes,
    /// Upright spines of random colours.
    Books,
    /// A few coloured blocks.
    Picture,
}

/// Effect of a surface on light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Optics {
    Opaque,
    /// Clear glass: a camera sees through it, a depth sensor measures it, passes it, or fails.
    Glass,
    Mirror,
}

/// Colour, texture, gloss and optics of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Finish {
    pub rgb: [f32; 3],
    pub pattern: Pattern,
    /// Size of one element of the pattern, in metres.
    pub scale_m: f32,
    /// 0 is matt, 1 is a mirror; shiny and dark surfaces return no depth.
    pub gloss: f32,
    pub optics: Optics,
}

impl Finish {
    pub fn plain(rgb: [f32; 3]) -> Finish {
        Finish { rgb, pattern: Pattern::Plain, scale_m: 0.1, gloss: 0.05, optics: Optics::Opaque }
    }

    /// Returns clear glass.
    pub fn glass() -> Finish {
        Finish { optics: Optics::Glass, ..Finish::plain([0.80, 0.88, 0.88]).glossy(0.9) }
    }

    pub fn mirror() -> Finish {
        Finish { optics: Optics::Mirror, ..Finish::plain([0.72, 0.77, 0.80]).glossy(0.9) }
    }

    pub fn with(self, pattern: Pattern, scale_m: f32) -> Finish {
        Finish { pattern, scale_m, ..self }
    }

    pub fn glossy(self, gloss: f32) -> Finish {
        Finish { gloss, ..self }
    }

    pub fn darker(self, factor: f32) -> Finish {
        Finish { rgb: self.rgb.map(|c| c * factor), ..self }
    }

    /// Returns the colour at a point of the surface. `across_m` and `up_m` are surface coordinates; `salt`
    /// distinguishes surfaces with the same finish.
    pub fn colour(&self, across_m: f32, up_m: f32, salt: u64) -> [f32; 3] {
        let cell = |value: f32, size: f32| (value / size).floor() as i64 as u64;
        let rng = |a: u64, b: u64| unit(hash(salt ^ hash(a.wrapping_mul(0x5851_f42d).wrapping_add(b))));
        let shade = |factor: f32| self.rgb.map(|c| c * factor);
        match self.pattern {
            Pattern::Plain => self.rgb,
            Pattern::Grain => shade(0.96 + 0.08 * rng(cell(across_m, 0.012), cell(up_m, 0.012))),
            Pattern::Planks => {
                let row = cell(up_m, self.scale_m);
                let shift = rng(row, 17) * 1.3;
                let board = cell(across_m + shift, 1.3);
                let joint = (up_m / self.scale_m).rem_euclid(1.0) < 0.03;
                let grain = 0.06 * rng(cell(across_m, 0.15), cell(up_m, 0.006));
                shade(if joint { 0.6 } else { 0.84 + 0.22 * rng(row, board) + grain })
            }
            Pattern::Tiles => {
                let joint =
                    |v: f32| (v / self.scale_m).rem_euclid(1.0) < 0.004 / self.scale_m.max(0.02) + 0.012;
                let tile = rng(cell(across_m, self.scale_m), cell(up_m, self.scale_m));
                shade(if joint(across_m) || joint(up_m) { 0.68 } else { 0.94 + 0.08 * tile })
            }
            Pattern::Stripes => {
                let phase = (across_m / self.scale_m).rem_euclid(1.0);
                shade(0.82 + 0.18 * (phase * std::f32::consts::TAU).sin().abs())
            }
            Pattern::Books => {
                let spine = cell(across_m, self.scale_m);
                let tint = |k: u64| 0.25 + 0.65 * rng(spine, k);
                [tint(1), tint(2), tint(3)]
            }
            Pattern::Picture => {
                let (x, y) = (cell(across_m, self.scale_m), cell(up_m, self.scale_m));
                let mix = rng(x / 2, y);
                [0, 1, 2]
                    .map(|k| self.rgb[k as usize] * 0.5 + 0.5 * rng(x ^ k, y / 2 + k) * (0.6 + 0.4 * mix))
            }
        }
    }
}

pub(super) const WHITE: [f32; 3] = [0.90, 0.90, 0.88];
pub(super) const METAL: [f32; 3] = [0.60, 0.61, 0.63];
pub(super) const DARK: [f32; 3] = [0.10, 0.10, 0.11];

/// Returns a random wood finish.
pub(super) fn wood(rng: &mut Rng) -> Finish {
    let tone = rng.pick([[0.72, 0.55, 0.36], [0.55, 0.38, 0.24], [0.38, 0.25, 0.16], [0.82, 0.70, 0.52]]);
    Finish::plain(tone).with(Pattern::Planks, 0.09).glossy(0.1)
}

/// Returns a cabinet's front: painted or wood.
pub(super) fn front(rng: &mut Rng) -> Finish {
    if rng.chance(0.45) {
        return wood(rng);
    }
    let tone =
        rng.pick([WHITE, [0.82, 0.80, 0.74], [0.55, 0.58, 0.60], [0.30, 0.36, 0.42], [0.62, 0.70, 0.62]]);
    Finish::plain(tone).with(Pattern::Grain, 0.1).glossy(0.15)
}

/// Returns cloth of a random colour.
pub(super) fn cloth(rng: &mut Rng) -> Finish {
    let grey = rng.between(0.25, 0.85) as f32;
    let tint = |rng: &mut Rng| (grey + rng.between(-0.18, 0.18) as f32).clamp(0.08, 0.95);
    let rgb = [tint(rng), tint(rng), tint(rng)];
    Finish::plain(rgb).with(Pattern::Grain, 0.02)
}

/// Returns wall paint of a random light colour.
pub(super) fn paint(rng: &mut Rng) -> Finish {
    let base = rng.between(0.72, 0.92) as f32;
    let tint = |rng: &mut Rng| (base + rng.between(-0.08, 0.06) as f32).clamp(0.5, 0.95);
    let rgb = [tint(rng), tint(rng), tint(rng)];
    Finish::plain(rgb).with(Pattern::Grain, 0.02)
}
