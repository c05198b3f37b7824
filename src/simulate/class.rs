//! What things are.

use serde::Serialize;

macro_rules! classes {
    ($($variant:ident = $id:literal $name:literal),+ $(,)?) => {
        /// The class of a solid, with a stable number for label pictures; 0 there means that nothing was hit.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Class {
            $($variant = $id),+
        }

        impl Class {
            pub const ALL: &[Class] = &[$(Class::$variant),+];

            pub fn name(self) -> &'static str {
                match self {
                    $(Class::$variant => $name),+
                }
            }
        }
    };
}

classes! {
    Floor = 1 "floor",
    Wall = 2 "wall",
    Ceiling = 3 "ceiling",
    Door = 4 "door",
    Window = 5 "window",
    Pillar = 6 "pillar",
    Bed = 7 "bed",
    Sofa = 8 "sofa",
    Armchair = 9 "armchair",
    Chair = 10 "chair",
    Table = 11 "table",
    Desk = 12 "desk",
    Cabinet = 13 "cabinet",
    Wardrobe = 14 "wardrobe",
    Shelf = 15 "shelf",
    Counter = 16 "counter",
    Refrigerator = 17 "refrigerator",
    Stove = 18 "stove",
    Toilet = 19 "toilet",
    Sink = 20 "sink",
    Bathtub = 21 "bathtub",
    Shower = 22 "shower",
    WashingMachine = 23 "washing_machine",
    Television = 24 "television",
    Lamp = 25 "lamp",
    Curtain = 26 "curtain",
    Plant = 27 "plant",
    Rug = 28 "rug",
    Picture = 29 "picture",
    Radiator = 30 "radiator",
    Mirror = 31 "mirror",
    Box = 32 "box",
    Clothes = 33 "clothes",
    Pillow = 34 "pillow",
}

impl Class {
    /// The number in label pictures.
    pub fn id(self) -> u16 {
        self as u16
    }

    /// Part of the building, that no day changes.
    pub fn is_structure(self) -> bool {
        matches!(self, Class::Floor | Class::Wall | Class::Ceiling | Class::Window | Class::Pillar)
    }
}
