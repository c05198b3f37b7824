//! NYU Depth v2's 40 classes (Gupta et al., 2013) as ScanNet numbers them, from 1; 0 is unlabelled.

use super::Class;
use super::Class::*;

pub(super) const CLASSES: [Class; 41] = [
    Other,        // 0 unlabelled
    Wall,         // 1 wall
    Floor,        // 2 floor
    Cabinet,      // 3 cabinet
    Bed,          // 4 bed
    Chair,        // 5 chair
    Sofa,         // 6 sofa
    Table,        // 7 table
    Door,         // 8 door
    Window,       // 9 window
    Shelf,        // 10 bookshelf
    Picture,      // 11 picture
    Counter,      // 12 counter
    Curtain,      // 13 blinds
    Desk,         // 14 desk
    Shelf,        // 15 shelves
    Curtain,      // 16 curtain
    Cabinet,      // 17 dresser
    Pillow,       // 18 pillow
    Mirror,       // 19 mirror
    Rug,          // 20 floor_mat
    Clothes,      // 21 clothes
    Ceiling,      // 22 ceiling
    Other,        // 23 books
    Refrigerator, // 24 refrigerator
    Television,   // 25 television
    Other,        // 26 paper
    Clothes,      // 27 towel
    Curtain,      // 28 shower_curtain
    Box,          // 29 box
    Picture,      // 30 whiteboard
    Person,       // 31 person
    Cabinet,      // 32 night_stand
    Toilet,       // 33 toilet
    Sink,         // 34 sink
    Lamp,         // 35 lamp
    Bathtub,      // 36 bathtub
    Box,          // 37 bag
    Other,        // 38 otherstructure
    Other,        // 39 otherfurniture
    Other,        // 40 otherprop
];
