//! Classes of things in a home, and the mapping of other class lists to them.

mod ade20k;
mod coco;
mod nyu40;
mod purpose;

pub use purpose::Purposes;

use serde::{Deserialize, Serialize};

macro_rules! classes {
    ($($variant:ident = $id:literal $name:literal $color:literal),+ $(,)?) => {
        /// The class of a point. Ids and names are stable: they are in stored maps and in label pictures.
        #[derive(
            Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize,
        )]
        #[serde(rename_all = "snake_case")]
        pub enum Class {
            $($variant = $id),+
        }

        impl Class {
            /// All classes; the index of a class is its id.
            pub const ALL: &[Class] = &[$(Class::$variant),+];

            pub fn name(self) -> &'static str {
                match self {
                    $(Class::$variant => $name),+
                }
            }

            /// Returns the colour as red, green and blue.
            pub fn color(self) -> [u8; 3] {
                let rgb: u32 = match self {
                    $(Class::$variant => $color),+
                };
                let [_, red, green, blue] = rgb.to_be_bytes();
                [red, green, blue]
            }
        }
    };
}

classes! {
    Other = 0 "other" 0x9a9a9a,
    Floor = 1 "floor" 0xc9a66b,
    Wall = 2 "wall" 0xb8c4d6,
    Ceiling = 3 "ceiling" 0xf2efe6,
    Door = 4 "door" 0x8c4b2f,
    Window = 5 "window" 0x7fd1ff,
    Stairs = 6 "stairs" 0xa0763c,
    Bed = 7 "bed" 0xe66a8a,
    Sofa = 8 "sofa" 0x3f9b57,
    Chair = 9 "chair" 0x8fd14f,
    Table = 10 "table" 0xff9d2e,
    Desk = 11 "desk" 0xd97b00,
    Cabinet = 12 "cabinet" 0x7b5bd6,
    Shelf = 13 "shelf" 0xa98bf0,
    Counter = 14 "counter" 0x5f6f9f,
    Refrigerator = 15 "refrigerator" 0x2f6fb5,
    Stove = 16 "stove" 0xb5302f,
    WashingMachine = 17 "washing_machine" 0x4fa3c7,
    Television = 18 "television" 0x24304a,
    Lamp = 19 "lamp" 0xffe95c,
    Radiator = 20 "radiator" 0xd0d6dc,
    Toilet = 21 "toilet" 0x00a8a0,
    Sink = 22 "sink" 0x2fd6c4,
    Bathtub = 23 "bathtub" 0x0f7f8f,
    Shower = 24 "shower" 0x66c2d9,
    Curtain = 25 "curtain" 0xc27fd1,
    Rug = 26 "rug" 0xd64f4f,
    Pillow = 27 "pillow" 0xf7a8c4,
    Clothes = 28 "clothes" 0x9f5f8f,
    Mirror = 29 "mirror" 0xa8e6ef,
    Picture = 30 "picture" 0xb59f2f,
    Plant = 31 "plant" 0x1f7a2f,
    Box = 32 "box" 0xbf8f5f,
    Person = 33 "person" 0xff3fa4,
    Animal = 34 "animal" 0xff7f50,
}

/// Number of classes.
pub const CLASSES: usize = Class::ALL.len();

impl Class {
    /// Returns the number in files and label pictures.
    pub fn id(self) -> u16 {
        self as u16
    }

    pub fn from_id(id: usize) -> Option<Class> {
        Class::ALL.get(id).copied()
    }

    /// Returns whether this is a permanent part of the building.
    pub fn is_structure(self) -> bool {
        matches!(self, Class::Floor | Class::Wall | Class::Ceiling | Class::Window | Class::Stairs)
    }

    /// Returns whether this is built in or too heavy to be moved. Other things may have moved between the day
    /// of the map and that of the clip.
    pub fn is_fixed(self) -> bool {
        self.is_structure()
            || matches!(
                self,
                Class::Door
                    | Class::Cabinet
                    | Class::Counter
                    | Class::Refrigerator
                    | Class::Stove
                    | Class::Radiator
                    | Class::Toilet
                    | Class::Sink
                    | Class::Bathtub
                    | Class::Shower
                    | Class::Mirror
            )
    }

    /// Returns whether this has a level top, or treads, broad enough to be mistaken for a floor. A flat
    /// surface of another class is mislabelled: walls, curtains and pictures do not lie flat.
    pub fn has_level_top(self) -> bool {
        matches!(
            self,
            Class::Stairs
                | Class::Bed
                | Class::Sofa
                | Class::Chair
                | Class::Table
                | Class::Desk
                | Class::Cabinet
                | Class::Shelf
                | Class::Counter
                | Class::Refrigerator
                | Class::Stove
                | Class::WashingMachine
                | Class::Toilet
                | Class::Sink
                | Class::Bathtub
                | Class::Shower
                | Class::Pillow
                | Class::Clothes
                | Class::Box
        )
    }

    /// Returns whether its surface is the floor's: the floor itself, or a thing that lies flat on it.
    pub fn is_ground(self) -> bool {
        matches!(self, Class::Floor | Class::Rug)
    }
}

/// Class lists of networks and data sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClassTable {
    /// The 150 classes of the ADE20K scene parsing benchmark, in its order (0 is `wall`).
    Ade20k,
    /// The 133 categories of COCO panoptic, 80 things and 53 kinds of stuff, numbered without gaps.
    Coco,
    /// The 40 classes of NYU Depth v2 as ScanNet's tables number them (1 is `wall`, 0 unlabelled).
    Nyu40,
    /// Our own ids.
    Home,
}

impl ClassTable {
    /// Returns our class for each of the table's ids, in their order.
    pub fn classes(self) -> &'static [Class] {
        match self {
            ClassTable::Ade20k => &ade20k::CLASSES,
            ClassTable::Coco => &coco::CLASSES,
            ClassTable::Nyu40 => &nyu40::CLASSES,
            ClassTable::Home => Class::ALL,
        }
    }

    /// Returns our class for an id of the table; unknown ids are [`Class::Other`].
    pub fn fold(self, id: usize) -> Class {
        self.classes().get(id).copied().unwrap_or(Class::Other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_places_and_names_and_colours_differ() {
        for (place, class) in Class::ALL.iter().enumerate() {
            assert_eq!(class.id() as usize, place);
            assert_eq!(Class::from_id(place), Some(*class));
            assert_eq!(serde_json::to_value(class).unwrap(), class.name());
            for other in &Class::ALL[..place] {
                assert_ne!(class.name(), other.name());
                assert_ne!(class.color(), other.color(), "{class:?} {other:?}");
            }
        }
        assert_eq!(Class::from_id(CLASSES), None);
    }

    /// Names from the publications of the data sets.
    #[test]
    fn tables_fold_what_homes_hold() {
        for (table, id, want) in [
            (ClassTable::Ade20k, 0, Class::Wall),
            (ClassTable::Ade20k, 3, Class::Floor),
            (ClassTable::Ade20k, 5, Class::Ceiling),
            (ClassTable::Ade20k, 7, Class::Bed),
            (ClassTable::Ade20k, 23, Class::Sofa),
            (ClassTable::Ade20k, 62, Class::Shelf),
            (ClassTable::Ade20k, 148, Class::Other),
            (ClassTable::Coco, 0, Class::Person),
            (ClassTable::Coco, 57, Class::Sofa),
            (ClassTable::Coco, 131, Class::Wall),
            (ClassTable::Coco, 132, Class::Rug),
            (ClassTable::Nyu40, 0, Class::Other),
            (ClassTable::Nyu40, 1, Class::Wall),
            (ClassTable::Nyu40, 24, Class::Refrigerator),
            (ClassTable::Nyu40, 36, Class::Bathtub),
            (ClassTable::Home, 7, Class::Bed),
            (ClassTable::Home, 700, Class::Other),
        ] {
            assert_eq!(table.fold(id), want, "{table:?} {id}");
        }
        assert_eq!(ClassTable::Ade20k.classes().len(), 150);
        assert_eq!(ClassTable::Coco.classes().len(), 133);
        assert_eq!(ClassTable::Nyu40.classes().len(), 41);
    }
}
