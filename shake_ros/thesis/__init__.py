"""The thesis run again: its figures, its experiments of chapter 6, its neural schedule. Nothing else imports it."""
