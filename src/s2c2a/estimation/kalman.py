"""The steps of a Kalman filter, as pure functions."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.kinematics.bends import Numbers

Matrix = Float[Numbers, "n n"]
Jacobian = Float[Numbers, "values n"]


def predict(
    covariance: Matrix, transition: Matrix, process_noise: Float[Numbers, " n"]
) -> Float[Array, "n n"]:
    """Covariance after one step: F P F' + Q.

    The caller predicts the mean, since the motion may be nonlinear.

    Args:
        covariance: P.
        transition: F, derivative of the motion by the state.
        process_noise: diagonal of Q.
    """
    propagated = transition @ covariance @ transition.T
    return jnp.asarray(propagated + jnp.diag(process_noise))


def innovation_covariance(
    covariance: Matrix, jacobian: Jacobian, noise_std: Float[Numbers, " values"]
) -> Float[Array, "values values"]:
    """Covariance of the innovation: S = H P H' + R."""
    predicted = jacobian @ covariance @ jacobian.T
    return jnp.asarray(predicted + jnp.diag(noise_std**2))


def update(
    mean: Float[Numbers, " n"],
    covariance: Matrix,
    residual: Float[Numbers, " values"],
    jacobian: Jacobian,
    innovation_cov: Float[Numbers, "values values"],
) -> tuple[Float[Array, " n"], Float[Array, "n n"]]:
    """Mean and covariance after a measurement, in Joseph's form.

    K = P H' S^-1, x + K r, (I - K H) P (I - K H)' + K R K', with R = S - H P H'.

    Joseph's form keeps the covariance positive semidefinite in single precision.

    Args:
        mean: x.
        covariance: P.
        residual: r, measured minus predicted; zero where a value is missing.
        jacobian: H; zero rows where a value is missing or rejected.
        innovation_cov: S.
    """
    gain = jnp.linalg.solve(innovation_cov, jacobian @ covariance).T
    remaining = jnp.eye(len(mean)) - gain @ jacobian
    noise = innovation_cov - jacobian @ covariance @ jacobian.T
    updated = remaining @ covariance @ remaining.T + gain @ noise @ gain.T
    return jnp.asarray(mean + gain @ residual), jnp.asarray(updated)
