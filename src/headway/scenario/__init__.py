"""Who follows whom, and what disturbs them."""
