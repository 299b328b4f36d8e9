"""A stranger beside a running fleet, who attacks it, and whether the fleet holds (`fogwatch chaos --hostile`)."""
