"""Two arms that nobody tuned for: any arm that the description allows must work."""

from s2c2a.arm import ArmSpec, Cable, Module, Motor


def five_cable_arm() -> ArmSpec:
    """Four modules of 0.2, 0.15, 0.15 and 0.1 m with five cables, tension, true configuration."""
    modules = tuple(
        Module(
            length=length,
            cable_radius=0.027,
            cable_angles_deg=(0.0, 72.0, 144.0, 216.0, 288.0),
            mass=0.25 * length,
            bending_stiffness=0.4,
            bend_limit_deg=250.0 * length,
            pretension=27.0,
            tension_range=27.0,
        )
        for length in (0.2, 0.15, 0.15, 0.1)
    )
    return ArmSpec(name="five_cable_arm", actuation="tension", sensing="true", modules=modules)


def two_module_arm() -> ArmSpec:
    """Two modules of 0.25 m with four cables, displacement, the twin's stretch and play, encoders."""
    modules = tuple(
        Module(
            length=0.25,
            cable_radius=0.027,
            cable_angles_deg=(0.0, 90.0, 180.0, 270.0),
            mass=0.1,
            bending_stiffness=0.12,
            bend_limit_deg=60.0,
            cable=cable,
        )
        for cable in (Cable(stiffness=5000, play=0.00045), Cable(stiffness=3300, play=0.0008))
    )
    motor = Motor(time_constant=0.05, speed_limit=0.2)
    return ArmSpec(name="two_module_arm", actuation="displacement", sensing="encoders", motor=motor, modules=modules)
