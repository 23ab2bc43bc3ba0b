"""What commands, reports, the service and Python share: files in, records out; nothing is printed, no option parsed."""
