"""Write the sample log that the package ships."""

from hovercontrol.samples import make_sample, sample_path

if __name__ == "__main__":
    print(f"wrote {make_sample().save(sample_path())}")
