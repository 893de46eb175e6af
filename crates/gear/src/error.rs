//! Reasons why a pair cannot be simulated, each with the numbers that decided.

use crate::accuracy::Range;
use crate::input::{InputError, Member};

/// Why a pair could not be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A number of the input is not finite or lies outside the domain of the model.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The input is well formed, but no such gear pair exists or it cannot carry the load.
    #[error(transparent)]
    Infeasible(#[from] Infeasibility),
}

/// Why a well-formed design cannot be simulated. Lengths in mm, angles in radians.
///
/// "No teeth interference" of the optimisation problems is not in this list: it is a constraint,
/// see [`Interference`](crate::Interference), and a design that breaks it can still be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Infeasibility {
    /// The profile shifts leave no positive working pressure angle at zero backlash.
    #[error(
        "the involute equation has no solution: the working pressure angle's involute would be \
         {inv_alpha_wt:.6}, it must be positive"
    )]
    NoInvoluteSolution {
        /// inv α_t + 2 (x1 + x2) tan α_n / (Z1 + Z2).
        inv_alpha_wt: f64,
    },
    /// The given centre distance is shorter than that without backlash.
    #[error(
        "the teeth jam: at the centre distance of {centre_distance:.4} mm they are {overlap:.4} mm too thick \
         for their spaces; without backlash it is {without_backlash:.4} mm"
    )]
    Jammed {
        /// a.
        centre_distance: f64,
        /// The negative backlash at the working pitch circles.
        overlap: f64,
        /// The centre distance of no backlash.
        without_backlash: f64,
    },
    /// The root circle has no positive radius.
    #[error("the {member} has a root circle radius of {root_radius:.4} mm, it must be positive")]
    RootCircleVanishes {
        /// The gear concerned.
        member: Member,
        /// r_f.
        root_radius: f64,
    },
    /// The tooth has no thickness above the base circle: its flanks meet below it.
    #[error(
        "the {member}'s tooth has no thickness at the base circle: its half angle there is \
         {half_angle:.6} rad, it must be positive"
    )]
    ToothWithoutThickness {
        /// The gear concerned.
        member: Member,
        /// ψ at the base circle.
        half_angle: f64,
    },
    /// The tip circle lies on or inside the base circle, so there is no involute.
    #[error(
        "the {member}'s tip circle radius {tip_radius:.4} mm must exceed its base circle radius \
         {base_radius:.4} mm"
    )]
    TipBelowBase {
        /// The gear concerned.
        member: Member,
        /// r_a, after cutting at the apex and after the tip rule.
        tip_radius: f64,
        /// r_b.
        base_radius: f64,
    },
    /// The tip circle lies on or inside the root circle.
    #[error(
        "the {member}'s tip circle radius {tip_radius:.4} mm must exceed its root circle radius \
         {root_radius:.4} mm"
    )]
    TipBelowRoot {
        /// The gear concerned.
        member: Member,
        /// r_a, after cutting at the apex and after the tip rule.
        tip_radius: f64,
        /// r_f.
        root_radius: f64,
    },
    /// The tip rounding reaches below the base circle.
    #[error(
        "the {member}'s tip rounding of {tip_rounding:.4} mm leaves no involute: its centre at \
         {centre_radius:.4} mm must lie outside the base circle of {base_radius:.4} mm"
    )]
    TipRoundingTooLarge {
        /// The gear concerned.
        member: Member,
        /// ρa.
        tip_rounding: f64,
        /// r_a − ρa.
        centre_radius: f64,
        /// r_b.
        base_radius: f64,
    },
    /// The rounded corners of the rack tooth overlap.
    #[error(
        "the {member}'s rack corner of {root_rounding:.4} mm does not fit between the rack's \
         flanks: its centre lies {overlap:.4} mm beyond the middle of the rack tooth"
    )]
    RackCornerDoesNotFit {
        /// The gear concerned.
        member: Member,
        /// ρf.
        root_rounding: f64,
        /// Distance of the corner's centre beyond the rack tooth's axis; positive.
        overlap: f64,
    },
    /// The rack corner sweeps a curve with a cusp: the fillet it would generate does not exist.
    #[error(
        "the {member}'s rack corner generates no smooth fillet: its centre lies {height:.4} mm \
         above the rolling line, where the swept curve has a cusp"
    )]
    FilletCusp {
        /// The gear concerned.
        member: Member,
        /// Height of the corner's centre above the rolling line; positive.
        height: f64,
    },
    /// The fillet (or the undercut) takes the whole flank.
    #[error(
        "the {member} has no involute flank: the involute would start at the tangent length \
         {start:.4} mm, beyond its end at {end:.4} mm"
    )]
    NoInvoluteFlank {
        /// The gear concerned.
        member: Member,
        /// Tangent length at which fillet or undercut hands over to the involute.
        start: f64,
        /// Tangent length of the last flank point.
        end: f64,
    },
    /// The undercuts of both flanks meet: the tooth falls off.
    #[error(
        "the {member}'s tooth is severed by its undercut: the half thickness left is \
         {half_thickness:.1e} mm"
    )]
    ToothSevered {
        /// The gear concerned.
        member: Member,
        /// Smallest half thickness met in the normal section, mm; a millionth of the module or less.
        half_thickness: f64,
    },
    /// The flanks meet below the reference circle, at whose thickness a prismatic beam is taken.
    #[error(
        "the {member}'s tooth has a thickness of {thickness:.4} mm at the reference circle, it must \
         be positive for the tooth model prismatic-beam"
    )]
    BeamWithoutThickness {
        /// The gear concerned.
        member: Member,
        /// s_n = m (π/2 + 2 x tan α_n).
        thickness: f64,
    },
    /// The integral of the tooth's bending compliance is not resolved, however finely the tooth is
    /// divided: its outline varies at the scale of rounding.
    #[error(
        "the {member}'s compliance integral did not converge: relative error {error:.1e}, required 1e-9"
    )]
    ComplianceUnresolved {
        /// The gear concerned.
        member: Member,
        /// Estimated relative error of the worst panel.
        error: f64,
    },
    /// The coupled cells of the contact lines have no stiffness: the pair is too far outside the range of
    /// the tooth model.
    #[error(
        "the compliance of the coupled contact has no inverse at the phase {phase:.3}: the pair is too far \
         outside the range of the tooth model ({} to {} teeth, faces of {} to {} modules, helix angles up to {} degrees)",
        Range::TEETH.limits[0], Range::TEETH.limits[1], Range::FACE_WIDTH.limits[0], Range::FACE_WIDTH.limits[1],
        Range::HELIX_ANGLE.limits[1]
    )]
    ContactUnresolved {
        /// Phase in base pitches.
        phase: f64,
    },
    /// The tip of the other gear would touch below this gear's base circle.
    #[error(
        "contact beyond the {member}'s base tangent point: the tip of the other gear reaches {reach:.4} mm \
         along a line of action that leaves {available:.4} mm"
    )]
    ContactBeyondBase {
        /// The gear whose base tangent point is passed.
        member: Member,
        /// Tangent length of the other gear's last flank point.
        reach: f64,
        /// L, the distance between the two base tangent points.
        available: f64,
    },
    /// Some mesh position has no pair of teeth in contact.
    #[error(
        "the teeth lose contact: the contact ratio {eps_alpha:.4} + {eps_beta:.4} (profile + \
         overlap) must exceed 1"
    )]
    ContactGap {
        /// ε_α; negative when the path of contact is empty.
        eps_alpha: f64,
        /// ε_β.
        eps_beta: f64,
    },
}

impl Infeasibility {
    /// A short stable name of the reason, for tables and statistics.
    #[must_use]
    pub const fn code(&self) -> &'static str {
        match self {
            Self::NoInvoluteSolution { .. } => "no-involute-solution",
            Self::Jammed { .. } => "jammed",
            Self::RootCircleVanishes { .. } => "root-circle-vanishes",
            Self::ToothWithoutThickness { .. } => "tooth-without-thickness",
            Self::TipBelowBase { .. } => "tip-below-base",
            Self::TipBelowRoot { .. } => "tip-below-root",
            Self::TipRoundingTooLarge { .. } => "tip-rounding-too-large",
            Self::RackCornerDoesNotFit { .. } => "rack-corner-does-not-fit",
            Self::FilletCusp { .. } => "fillet-cusp",
            Self::NoInvoluteFlank { .. } => "no-involute-flank",
            Self::ToothSevered { .. } => "tooth-severed",
            Self::BeamWithoutThickness { .. } => "beam-without-thickness",
            Self::ComplianceUnresolved { .. } => "compliance-unresolved",
            Self::ContactUnresolved { .. } => "contact-unresolved",
            Self::ContactBeyondBase { .. } => "contact-beyond-base",
            Self::ContactGap { .. } => "contact-gap",
        }
    }
}
