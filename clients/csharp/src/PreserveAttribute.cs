using System;

namespace Nep
{
    /// <summary>Keeps Unity's linker from removing code that Newtonsoft.Json finds by reflection.</summary>
    /// <remarks>
    /// The linker obeys any attribute of this name. A <c>link.xml</c> would be ignored in a package that is installed from a
    /// tarball or a registry.
    /// </remarks>
    [AttributeUsage(AttributeTargets.Assembly)]
    internal sealed class PreserveAttribute : Attribute
    {
    }
}
