"""Commands that compute: simulate, identify, validate, explain, design; from files to files, no device is touched."""
