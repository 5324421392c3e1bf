"""The hydraulic fluid: one oil with its viscosity and density, and its flow through pipes and orifices.

Every function takes numbers or numpy arrays and is compiled, so that figures and the plant use the same code.
"""
