"""The hydraulic fluid: viscosity, density, flow through pipes and orifices; one file per law.

Every function takes numbers or numpy arrays and is compiled, so that figures and the plant use the same code.
"""
