"""ONNX models from functions of JAX arrays.

JAX traces the function into a list of primitive operations (a jaxpr) with static
shapes. Each becomes nodes of ONNX (`rules`), or is written as a function of simpler
operations (`decompositions`), which JAX traces in turn.
"""
