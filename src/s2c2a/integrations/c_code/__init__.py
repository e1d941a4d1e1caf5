"""C99 from functions of JAX arrays.

JAX traces the function into a list of primitive operations (a jaxpr) with static
shapes; every operation becomes loops over arrays at fixed places of one workspace.
Nothing is allocated, and nothing but the C library's mathematics is called.
"""
