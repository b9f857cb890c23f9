//! What stands beside the roads.

use glam::DVec2;

use crate::footprint::Footprint;

/// What a thing is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A house with a pitched roof, up to four storeys.
    House,
    /// A larger building with a flat roof.
    Block,
    Barn,
    /// The footprint is the trunk's; the crown is as wide as half the height.
    Tree,
    Lamp,
    /// A post at the edge of a road without side-walks.
    Post,
    /// An edge of stone between carriageway and side-walk; lower than a wheel.
    Kerb,
    /// Crops, grass: nothing that stops a car.
    Field,
}

/// A thing: a box that stands on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thing {
    pub kind: Kind,
    pub footprint: Footprint,
    pub height_m: f64,
    /// Place in [`Kind::colours`].
    pub colour: u8,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Kind; 8] = [
        Kind::House,
        Kind::Block,
        Kind::Barn,
        Kind::Tree,
        Kind::Lamp,
        Kind::Post,
        Kind::Kerb,
        Kind::Field,
    ];

    /// Whether a car that meets it has had an accident.
    pub fn is_obstacle(self) -> bool {
        !matches!(self, Kind::Kerb | Kind::Field)
    }

    /// Colours that it comes in, sRGB: of walls, crowns, posts and crops.
    pub fn colours(self) -> &'static [[u8; 3]] {
        match self {
            Kind::House => &[
                [196, 168, 140],
                [178, 104, 84],
                [214, 204, 184],
                [164, 148, 128],
                [198, 182, 120],
                [150, 96, 80],
            ],
            Kind::Block => &[
                [150, 152, 156],
                [176, 164, 150],
                [132, 140, 150],
                [186, 182, 172],
                [140, 116, 100],
            ],
            Kind::Barn => &[[128, 72, 60], [120, 110, 96]],
            Kind::Tree => &[[60, 104, 52], [76, 120, 58], [54, 92, 60], [92, 124, 56]],
            Kind::Lamp => &[[96, 100, 104]],
            Kind::Post => &[[232, 232, 230]],
            Kind::Kerb => &[[158, 155, 149]],
            Kind::Field => &[[186, 176, 96], [142, 160, 84], [120, 150, 76], [160, 132, 92]],
        }
    }
}

/// A box at a place, square.
pub fn square(centre_m: DVec2, heading_rad: f64, side_m: f64) -> Footprint {
    Footprint::new(centre_m, heading_rad, DVec2::splat(0.5 * side_m))
}
