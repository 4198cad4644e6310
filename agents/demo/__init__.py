"""`llrp demo`: all agents as processes over the bus, a view of them meanwhile, a report at the end."""
