"""Commands about throws and tables."""
