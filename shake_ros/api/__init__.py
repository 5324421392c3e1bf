"""The Python face, a file a verb: what `import shake_ros` offers. Nothing here prints, parses arguments or exits."""
