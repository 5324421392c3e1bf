"""What the studies of config/studies list and measure: plain functions of a row's values."""
