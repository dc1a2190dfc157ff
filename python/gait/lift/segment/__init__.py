"""Single segments, estimated by the C library, and the views in which they are observed."""
