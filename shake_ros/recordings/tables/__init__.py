"""Tables that somebody else wrote (text, .xlsx, .tdms, .mat) → columns in SI units."""
