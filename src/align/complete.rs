//! Stage 10: what the clip did not see at the vacuum's height is filled in, marked as such, and the clip is
//! registered again (paper III-D).

pub mod inpaint;
pub mod monocular;
