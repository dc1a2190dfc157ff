"""Read motion capture files as arrays (.amc/.asf, .bvh, .c3d, .trc and .csv), and marker sets."""
