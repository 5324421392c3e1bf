"""The shaking table: parameters, states, the one right-hand side, sensors, integration."""
