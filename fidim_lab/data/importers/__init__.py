"""Other labs' recordings as they come: one file for each kind, `registry` lists them, `recording` is what all become.

An importer only reads: units made SI, files checked, nothing estimated. What has to be estimated (marker cluster,
registration, clocks, hand-free windows) is the same for every kind: `fidim_lab.app.records.import_recording`.
"""
