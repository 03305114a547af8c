using System;

namespace Nep
{
    /// <summary>Attribute that keeps Unity's linker from removing code that Newtonsoft.Json uses by reflection.</summary>
    /// <remarks>
    /// The linker recognizes any attribute with this name. It ignores a <c>link.xml</c> in packages installed from a tarball or a
    /// registry.
    /// </remarks>
    [AttributeUsage(AttributeTargets.Assembly)]
    internal sealed class PreserveAttribute : Attribute
    {
    }
}
