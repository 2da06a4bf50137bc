"""Bus below the drive: adapter, link, one owner per drive, node with NMT and SDO."""
