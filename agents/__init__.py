"""What runs: processes that meet on Zenoh, and the command line `llrp`. The top floor."""
