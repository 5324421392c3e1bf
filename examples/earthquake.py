"""Track an earthquake in closed loop, and compare what the table did with what it should do."""

import shake_ros as sr

for controller in ("feedforward_pi_tuned", "super_twisting_tuned"):
    run = sr.simulate("bergamo", "earthquake_stiff_soil", controller=controller, observer="linear_bergamo", delay=1)
    print(controller)
    print(run.error)
spectrum = run.spectrum(damping=0.05)
print(spectrum)
spectrum.plot().savefig("spectrum.png")
