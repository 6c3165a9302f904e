"""Plans and schemes of networks, and figures of them in SVG."""
