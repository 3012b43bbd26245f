//! The colours of groups, the same in plots and recordings.

/// The colours of Okabe and Ito that show on white, as red, green and blue. Colour-blind people can distinguish them.
pub(crate) const GROUP_COLOURS: [(u8, u8, u8); 7] =
    [(0, 114, 178), (230, 159, 0), (0, 158, 115), (204, 121, 167), (86, 180, 233), (120, 94, 60), (213, 94, 0)];
