"""Motion capture files as arrays: readers of .amc/.asf, .bvh, .c3d, .trc and .csv, and the marker sets."""
