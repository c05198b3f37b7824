//! Voxels under construction as bytes.

use super::super::varint::{Reader, put, put_place, put_signed};
use super::{NOBODY, Voxel, Voxels};
use crate::MAP_VOXEL_M;
use crate::ply::UnknownFileFormat;
use viola_geometry::taxonomy::Class;

impl Voxels {
    /// Appends the voxels in the order of their places; [`Voxels::read`] is the inverse.
    pub fn write(&self, out: &mut Vec<u8>) {
        let order = self.ordered(|voxel| voxel.points > 0);
        put(out, order.len() as u64);
        for (key, place) in order {
            put_place(out, key);
            self.voxels[place as usize].1.write(out);
        }
    }

    pub(in super::super) fn read(reader: &mut Reader, clips: usize) -> Result<Voxels, UnknownFileFormat> {
        let mut voxels = Voxels::new(MAP_VOXEL_M);
        for _ in 0..reader.count()? {
            let key = reader.place()?;
            let voxel = Voxel::read(reader)?;
            if usize::from(voxel.most.0) >= clips {
                return Err(UnknownFileFormat);
            }
            *voxels.at(key) = voxel;
        }
        Ok(voxels)
    }
}

impl Voxel {
    fn write(&self, out: &mut Vec<u8>) {
        for value in [self.weight, self.points, self.color_weight, self.views, self.most.1] {
            put_signed(out, value);
        }
        for value in self.position.iter().chain(&self.normal).chain(&self.color) {
            put_signed(out, *value);
        }
        put(out, u64::from(self.most.0));
        for classes in [&self.seen, &self.blind] {
            put(out, u64::from(classes.total));
            put(out, classes.sums.len() as u64);
            for (class, sum) in &classes.sums {
                put(out, class.id() as u64);
                put(out, u64::from(*sum));
            }
        }
    }

    fn read(reader: &mut Reader) -> Result<Voxel, UnknownFileFormat> {
        let mut voxel = Voxel { now: NOBODY, ..Voxel::default() };
        let Voxel { weight, points, color_weight, views, most, .. } = &mut voxel;
        for value in [weight, points, color_weight, views, &mut most.1] {
            *value = reader.signed()?;
        }
        for sums in [&mut voxel.position, &mut voxel.normal, &mut voxel.color] {
            for value in sums {
                *value = reader.signed()?;
            }
        }
        voxel.most.0 = reader.narrow()?;
        for classes in [&mut voxel.seen, &mut voxel.blind] {
            classes.total = reader.narrow()?;
            for _ in 0..reader.count()? {
                let class = Class::from_id(reader.narrow()?).ok_or(UnknownFileFormat)?;
                classes.sums.push((class, reader.narrow()?));
            }
        }
        Ok(voxel)
    }
}
