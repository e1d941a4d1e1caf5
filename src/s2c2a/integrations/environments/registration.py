"""Names of the environments in Gymnasium, such as `S2C2A/Reach-v0`.

Importing this module registers them.
"""

from gymnasium.envs.registration import register

PACKAGE = "s2c2a.integrations.environments"
NAMES = ("Reach", "Track", "Avoid", "Hold", "Follow")
"""As `tasks.FAMILIES`, which loads JAX."""
TASKS: dict[str, dict[str, str | None]] = {name: {"task": name} for name in NAMES}
TASKS["Task"] = {"task": None}  # the user gives a class

for name, arguments in TASKS.items():
    register(
        f"S2C2A/{name}-v0",
        entry_point=f"{PACKAGE}.environment:ArmEnv",
        vector_entry_point=f"{PACKAGE}.vector_environment:ArmVectorEnv",
        kwargs=arguments,
    )
