"""Full scan or CAD model to Prior: what is known before the motor is clamped."""
